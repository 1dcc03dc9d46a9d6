// SPDX-License-Identifier: Apache-2.0
// The same phase function said in different ways makes the same picture.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "image/scratch.h"
#include "methods/rendering.h"
#include "scattering/phase.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using namespace virga::testing;

// A thick ball, lit from the side by a lamp of some size: all techniques of path have a part in it.
std::string ball(const std::string& phase) {
  return R"(<sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/></film></sensor>
    <shape type="sphere"><point name="center" x="3" y="1" z="1"/><float name="radius" value="0.5"/>
    <emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>
    <shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous"><float name="sigma_t" value="2"/>
    <float name="albedo" value="0.9"/>)" +
         phase + "</medium></shape>";
}

// A table of some phase function, fine enough to be the same.
template <class Phase>
std::string tableOf(const Phase& phase) {
  constexpr int kCount = 2001;
  std::string values;
  for (int i = 0; i < kCount; ++i) {
    const float c = -1 + 2 * static_cast<float>(i) / (kCount - 1);
    values += fmt::format("{}, ", phase.value({0, 0, 1}, {std::sqrt(std::max(0.f, 1 - c * c)), 0, -c}));
  }
  return "<phase type=\"tabphase\"><string name=\"values\" value=\"" + values + "\"/></phase>";
}

stats::Moments brightness(const std::string& phase, uint64_t seed) {
  return replicateMoments(rendered(sceneOf(ball(phase)), {.passes = 1024, .seed = seed}).film());
}

// Differences of 5 % are found almost certainly: the standard errors add up to less than 1.2 %.
void expectSame(const std::string& phase, const std::string& table) {
  const stats::Moments a = brightness(phase, 1), b = brightness(table, 2);
  EXPECT_GT(stats::welchTest(a, b), 1e-4) << a.mean() << " and " << b.mean();
  EXPECT_LT(a.standardError() + b.standardError(), 1.2e-2 * a.mean()) << "too few samples to tell";
}

std::string blend(const std::string& weight) {
  return R"(<phase type="blendphase">)" + weight + R"(<phase type="hg"><float name="g" value="0.7"/></phase>
    <phase type="cornette_shanks"><float name="g" value="-0.6"/></phase></phase>)";
}

TEST(PhaseEquivalence, SchlickIsItsTable) {
  expectSame(R"(<phase type="schlick"><float name="k" value="0.8"/></phase>)", tableOf(Schlick{0.8f}));
}

TEST(PhaseEquivalence, RayleighIsItsTable) { expectSame(R"(<phase type="rayleigh"/>)", tableOf(Rayleigh{})); }

TEST(PhaseEquivalence, ABlendIsTheTableOfItsSum) {
  const PlainPhase lobes[] = {PlainPhase(HenyeyGreenstein{0.7f}), PlainPhase(CornetteShanks{-0.6f})};
  expectSame(blend(R"(<float name="weight" value="0.3"/>)"), tableOf(PhaseMixture{lobes, 2, {0.7f, 0.3f}}));
}

TEST(PhaseEquivalence, AnotherPhaseFunctionIsNoticed) {
  const stats::Moments a = brightness(R"(<phase type="schlick"><float name="k" value="0.8"/></phase>)", 1);
  const stats::Moments b = brightness(tableOf(Schlick{0.7f}), 2);
  EXPECT_LT(stats::welchTest(a, b), 1e-4) << a.mean() << " and " << b.mean();
}

TEST(PhaseEquivalence, AGridOfOneWeightIsThatWeight) {
  const std::filesystem::path file = scratchFile("weight.vol");
  DenseVolume volume;
  volume.nx = volume.ny = volume.nz = 2;
  volume.values.assign(8, 0.25f);
  writeVol(file, volume);
  const std::string grid = fmt::format(
      R"(<volume name="weight" type="gridvolume"><string name="filename" value="{}"/><transform name="to_world">
      <translate value="-0.5"/><scale value="4"/></transform></volume>)",
      file.string());
  const RenderSession byGrid = rendered(sceneOf(ball(blend(grid)))),
                      byNumber = rendered(sceneOf(ball(blend(R"(<float name="weight" value="0.25"/>)"))));
  EXPECT_EQ(largestDifference(byGrid.film().beauty(), byNumber.film().beauty()), 0);
}

}  // namespace
}  // namespace virga
