// SPDX-License-Identifier: Apache-2.0
// Phase functions of scene files.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "loaders/loading.h"
#include "scene/scenes.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

std::string medium(const std::string& phase) {
  return "<shape type=\"cube\"><bsdf type=\"null\"/><medium name=\"interior\" type=\"homogeneous\">" + phase +
         "</medium></shape>";
}

PhaseFunction phaseOf(const std::string& phase, const std::string& directory = ".") {
  static SceneSnapshot scene;  // keeps what the phase function refers to
  scene = test::build("<emitter type=\"constant\"/>" + medium(phase), directory);
  return scene->view.media[0].phase;
}

std::string withValue(const std::string& type, const std::string& parameter, const std::string& value,
                      const std::string& kind = "float") {
  return fmt::format("<phase type=\"{}\"><{} name=\"{}\" value=\"{}\"/></phase>", type, kind, parameter, value);
}

std::string table(const std::string& values) { return withValue("tabphase", "values", values, "string"); }

std::string blend(const std::string& weight, const std::string& a, const std::string& b) {
  return "<phase type=\"blendphase\">" + weight + a + b + "</phase>";
}
std::string share(const std::string& value) { return "<float name=\"weight\" value=\"" + value + "\"/>"; }

constexpr const char* kForward = "<phase type=\"hg\"><float name=\"g\" value=\"0.8\"/></phase>";
constexpr const char* kEven = "<phase type=\"isotropic\"/>";
constexpr const char* kRayleigh = "<phase type=\"rayleigh\"/>";
constexpr const char* kTable = "<phase type=\"tabphase\"><string name=\"values\" value=\"1, 2, 4, 8, 0.5\"/></phase>";

float atCosine(const PhaseFunction& phase, float c) { return phase.value({0, 0, 1}, {std::sqrt(1 - c * c), 0, -c}); }

/// Building must fail at the mark.
void expectError(const std::string& marked, const std::string& message, const std::string& hint,
                 const std::string& directory = ".") {
  const loading::Marked text("<scene version=\"3.0.0\">\n" + medium(marked) + test::kSensor + "\n</scene>");
  const auto error = loading::errorOf([&] { buildScene(parseMitsubaXml(text.text, "test.xml", directory)); });
  ASSERT_TRUE(error) << "builds: " << marked;
  EXPECT_EQ(error->message(), message);
  EXPECT_EQ(error->details().hint, hint);
  EXPECT_EQ(error->details().position.offset, text.offset) << error->what();
  EXPECT_EQ(error->details().position.length, text.length) << error->what();
}

TEST(Phases, AreBuiltByName) {
  EXPECT_EQ(phaseOf(""), PhaseFunction(Isotropic{}));
  EXPECT_EQ(phaseOf(kForward), PhaseFunction(HenyeyGreenstein{0.8f}));
  EXPECT_EQ(phaseOf(kRayleigh), PhaseFunction(Rayleigh{}));
  EXPECT_EQ(phaseOf(withValue("schlick", "k", "-0.25")), PhaseFunction(Schlick{-0.25f}));
  EXPECT_EQ(phaseOf(withValue("schlick", "g", "0.5")), PhaseFunction(Schlick{1.55f * 0.5f - 0.55f * 0.125f}));
  EXPECT_EQ(phaseOf("<phase type=\"schlick\"/>"), PhaseFunction(Schlick{Schlick::likeHenyeyGreenstein(0.8f)}));
}

// The numbers are those of Mitsuba 3.9 too.
TEST(Phases, TablesRunFromBackwardToForward) {
  for (const char* values : {"1, 2, 4, 8, 0.5", "1 2 4 8 .5", " 1,2,\n4,8,5e-1, "}) {
    const PhaseFunction phase = phaseOf(table(values));
    EXPECT_NEAR(atCosine(phase, -1), 0.0215803313, 1e-7) << values;
    EXPECT_NEAR(atCosine(phase, 0.6f), 0.140272153, 1e-7) << values;
    EXPECT_NEAR(atCosine(phase, 1), 0.0107901656, 1e-7) << values;
  }
}

// Likewise.
TEST(Phases, TheWeightOfABlendIsTheShareOfTheSecond) {
  const PhaseFunction phase = phaseOf(blend(share("0.25"), kForward, kEven));
  EXPECT_NEAR(atCosine(phase, 0.6f), 0.0582112825, 1e-7);
  EXPECT_NEAR(atCosine(phase, 1), 2.70563403, 2e-6);
  EXPECT_NEAR(atCosine(phaseOf(blend(share("0"), kForward, kEven)), 1), atCosine(phaseOf(kForward), 1), 2e-6);
  EXPECT_NEAR(atCosine(phaseOf(blend(share("1"), kForward, kEven)), 1), kInv4Pi, 1e-7);
}

// Likewise.
TEST(Phases, BlendsNest) {
  const PhaseFunction phase = phaseOf(blend(share("0.25"), kForward, blend(share("0.4"), kRayleigh, kTable)));
  EXPECT_NEAR(atCosine(phase, -1), 0.0237471064, 1e-7);
  EXPECT_NEAR(atCosine(phase, 0.6f), 0.0645194831, 1e-7);
  const PhaseFunction four =
      phaseOf(blend(share("0.5"), blend(share("0.5"), kForward, kEven), blend(share("0.5"), kRayleigh, kTable)));
  ASSERT_TRUE(four.get<PhaseMixture>());
  EXPECT_EQ(four.get<PhaseMixture>()->count, 4);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(four.get<PhaseMixture>()->weights[i], 0.25f);
}

TEST(Phases, EqualOnesMakeEqualMedia) {
  const auto media = [](const std::string& a, const std::string& b) {
    return test::build("<emitter type=\"constant\"/>" + medium(a) + medium(b))->view.media.size;
  };
  EXPECT_EQ(media(kTable, table("1 2 4 8 0.5")), 1);
  EXPECT_EQ(media(kTable, table("1 2 4 8 0.6")), 2);
  EXPECT_EQ(media(blend(share("0.25"), kForward, kTable), blend(share("0.25"), kForward, kTable)), 1);
  EXPECT_EQ(media(blend(share("0.25"), kForward, kTable), blend(share("0.26"), kForward, kTable)), 2);
  EXPECT_EQ(media(blend(share("0.25"), kForward, kTable), blend(share("0.25"), kTable, kForward)), 2);
}

DenseVolume ramp(std::vector<float> values) {
  DenseVolume volume;
  volume.nx = static_cast<int>(values.size()), volume.ny = volume.nz = 1;
  volume.values = std::move(values);
  return volume;
}

std::string grid(const std::string& file) {
  return "<volume name=\"weight\" type=\"gridvolume\"><string name=\"filename\" value=\"" + file + "\"/></volume>";
}

TEST(Phases, WeightsMayBeVolumes) {
  const loading::TemporaryFolder folder;
  writeVol(folder.path() / "ramp.vol", ramp({0, 1}));
  const auto built = [&](const std::string& phase) {
    return test::build("<emitter type=\"constant\"/>" + medium(phase), folder.path().string());
  };
  // Voxel centres at x = 1/4 and 3/4.
  const SceneSnapshot scene = built(blend(grid("ramp.vol"), kForward, kEven));
  const MediumView& m = scene->view.media[0];
  const auto weightOfSecond = [&](float x) { return m.phaseAt({x, 0.3f, 0.8f}).get<PhaseMixture>()->weights[1]; };
  EXPECT_EQ(weightOfSecond(0.1f), 0);
  EXPECT_NEAR(weightOfSecond(0.35f), 0.2, 1e-6);
  EXPECT_NEAR(weightOfSecond(0.5f), 0.5, 1e-6);
  EXPECT_EQ(weightOfSecond(0.9f), 1);
  EXPECT_EQ(weightOfSecond(-0.9f), 0) << "outside of the grid the first remains";
  EXPECT_NEAR(atCosine(m.phaseAt({0.5f, 0.5f, 0.5f}), 0.6f), 0.0653333466, 1e-7) << "as Mitsuba 3.9";

  const SceneSnapshot nested =
      built(blend(share("0.5"), kRayleigh, blend(grid("ramp.vol"), kForward, blend(share("0.25"), kEven, kTable))));
  const PhaseFunction phase = nested->view.media[0].phaseAt({0.35f, 0.5f, 0.5f});
  const float expected[] = {0.5f, 0.4f, 0.075f, 0.025f};
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(phase.get<PhaseMixture>()->weights[i], expected[i], 1e-6) << i;

  const SceneSnapshot constant = built(blend(
      "<volume name=\"weight\" type=\"constvolume\"><float name=\"value\" value=\"0.25\"/></volume>", kForward, kEven));
  EXPECT_EQ(constant->view.media[0].phaseBlends.size, 0);
  EXPECT_NEAR(atCosine(constant->view.media[0].phase, 0.6f), 0.0582112825, 1e-7);

  const std::string same = blend(grid("ramp.vol"), kForward, kEven);
  EXPECT_EQ(test::build("<emitter type=\"constant\"/>" + medium(same) + medium(same), folder.path().string())
                ->view.media.size,
            1);
}

TEST(Phases, BadTables) {
  const std::string two = "list them from backward to forward scattering, with commas between them";
  expectError("<phase type=\"[[tabphase]]\"/>", "a tabphase needs two values or more, this one has 0", two);
  expectError(table("[[1]]"), "a tabphase needs two values or more, this one has 1", two);
  expectError(table("[[0, 0, 0]]"), "all values are 0", "");
  for (const char* bad : {"-1", "nan", "inf", "1e39", "x", "1x", "-nan", "0x"})
    expectError(table(fmt::format("[[1, {}, 2]]", bad)), fmt::format("\"{}\" is not a finite number >= 0", bad), "");
  expectError(withValue("tabphase", "values", "[[1]]"), "\"values\" must be a string, not a float", "");
}

TEST(Phases, BadAsymmetries) {
  for (const char* type : {"hg", "cornette_shanks", "schlick"})
    for (const char* g : {"1", "-1", "1.5"})
      expectError(withValue(type, "g", fmt::format("[[{}]]", g)), fmt::format("\"g\" is {}; it must be in (-1, 1)", g),
                  "");
  expectError(withValue("schlick", "k", "[[1]]"), "\"k\" is 1; it must be in (-1, 1)", "");
  for (const char* sign : {"", "-"})
    expectError(withValue("schlick", "g", fmt::format("[[{}0.97]]", sign)),
                fmt::format("g = {0}0.97 stands for k = {0}1.0015, which must lie between -1 and 1", sign),
                "keep |g| below 0.938, or give \"k\"");
  EXPECT_TRUE(phaseOf(withValue("schlick", "g", "0.938")).get<Schlick>());
  expectError("<phase type=\"schlick\"><float name=\"g\" value=\"0.1\"/><float name=\"k\" value=\"[[0.1]]\"/></phase>",
              "give either \"g\" or \"k\", not both", "");
}

TEST(Phases, BadBlends) {
  const loading::TemporaryFolder folder;
  writeVol(folder.path() / "two.vol", ramp({0, 2}));
  expectError("<phase type=\"[[blendphase]]\">" + share("0.5") + kEven + "</phase>",
              "a blendphase blends two phase functions, this one has 1", "put two <phase> elements into it");
  expectError("<phase type=\"[[blendphase]]\">" + share("0.5") + kEven + kEven + kEven + "</phase>",
              "a blendphase blends two phase functions, this one has 3", "put two <phase> elements into it");
  expectError("<phase type=\"[[blendphase]]\">" + std::string(kEven) + kEven + "</phase>",
              "a blendphase needs a \"weight\"", "give the share of the second phase function, from 0 to 1");
  for (const char* weight : {"1.01", "-0.01"})
    expectError(blend(share(fmt::format("[[{}]]", weight)), kEven, kForward),
                fmt::format("\"weight\" is {}; it must be in [0, 1]", weight), "");
  expectError(blend("<[[volume]] name=\"weight\" type=\"gridvolume\"><string name=\"filename\" "
                    "value=\"two.vol\"/></volume>",
                    kEven, kForward),
              "the weight reaches 2; it must be at most 1", "", folder.path().string());
  expectError(blend("<[[volume]] name=\"weight\" type=\"constvolume\"><rgb name=\"value\" value=\"0, 1, 0\"/></volume>",
                    kEven, kForward),
              "a volume of numbers is needed here, and this one has a colour", "give one value");
  const std::string half = blend(share("0.5"), kEven, kForward);
  expectError(blend(share("0.5"), half, blend(share("0.5"), half, "<phase type=\"[[rayleigh]]\"/>")),
              "more than 4 phase functions in one blend", "leave some out, or make a tabphase of them");
  expectError("<phase type=\"blendphase\">" + share("0.5") + kEven +
                  "<phase type=\"hg\"><float name=\"[[q]]\" value=\"1\"/></phase></phase>",
              "unknown parameter \"q\" of phase \"hg\"", "");
}

}  // namespace
}  // namespace virga
