// SPDX-License-Identifier: Apache-2.0
// Textures by their values at known places, and what is said about bad ones. Numbers without a derivation were taken
// from Mitsuba 3.9.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "image/image_io.h"
#include "loaders/loading.h"
#include "scene/scene_parts.h"
#include "scene/scenes.h"

namespace virga {
namespace {

/// 3 x 2 pixels: 0.1 to 0.6 by rows.
struct Pictures {
  loading::TemporaryFolder folder;
  Image ramp{3, 2};

  Pictures() {
    for (size_t i = 0; i < ramp.pixels.size(); ++i) ramp.pixels[i] = Rgb(static_cast<float>(i + 1) / 10);
    write("ramp.exr", ramp);
  }
  void write(const std::string& name, const Image& image) const { writeExr(folder.path() / name, image); }
  SceneSnapshot build(const std::string& elements) const {
    return test::build(elements + "<emitter type=\"constant\"/>", folder.path().string());
  }
  TextureView texture(const std::string& parameters, const std::string& file = "ramp.exr") {
    kept =
        build(fmt::format("<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\">"
                          "<string name=\"filename\" value=\"{}\"/>{}</texture></bsdf></shape>",
                          file, parameters));
    EXPECT_EQ(kept->view.textures.size, 1);
    return kept->view.textures[0];
  }
  SceneSnapshot kept;
};

std::string word(const char* name, const char* value) {
  return fmt::format("<string name=\"{}\" value=\"{}\"/>", name, value);
}

TEST(Bitmap, WrapsAndFiltersAsMitsubaDoes) {
  Pictures pictures;
  const Vec2 uvs[] = {{0.5f / 3, 0.25f}, {0.5f / 3, 0.75f}, {2.5f / 3, 0.25f}, {0.01f, 0.25f},
                      {0.99f, 0.9f},     {1.2f, -0.3f},     {-0.2f, 1.4f}};
  struct Row {
    const char *filter, *wrap;
    float expected[7];
  };
  for (const Row& row : {Row{"nearest", "repeat", {0.1f, 0.4f, 0.3f, 0.1f, 0.6f, 0.4f, 0.3f}},
                         {"nearest", "mirror", {0.1f, 0.4f, 0.3f, 0.1f, 0.6f, 0.3f, 0.4f}},
                         {"nearest", "clamp", {0.1f, 0.4f, 0.3f, 0.1f, 0.6f, 0.3f, 0.4f}},
                         {"bilinear", "repeat", {0.1f, 0.4f, 0.3f, 0.194f, 0.416f, 0.38f, 0.38f}},
                         {"bilinear", "mirror", {0.1f, 0.4f, 0.3f, 0.1f, 0.6f, 0.32f, 0.32f}},
                         {"bilinear", "clamp", {0.1f, 0.4f, 0.3f, 0.1f, 0.6f, 0.3f, 0.4f}}}) {
    const TextureView t = pictures.texture(word("filter_type", row.filter) + word("wrap_mode", row.wrap));
    for (int i = 0; i < 7; ++i)
      EXPECT_NEAR(t.lookup(uvs[i]).g, row.expected[i], 1e-5f) << row.filter << " " << row.wrap << " " << i;
  }
}

TEST(Bitmap, IsPlacedByToUv) {
  Pictures pictures;
  const Vec2 uvs[] = {{0.5f / 3, 0.25f}, {0.5f / 3, 0.75f}, {2.5f / 3, 0.25f}, {0.01f, 0.25f}};
  const auto expectValues = [&](const char* steps, std::initializer_list<float> expected) {
    const TextureView t = pictures.texture(word("filter_type", "nearest") +
                                           fmt::format("<transform name=\"to_uv\">{}</transform>", steps));
    size_t i = 0;
    for (const float e : expected) {
      EXPECT_NEAR(t.lookup(uvs[i]).g, e, 1e-6f) << steps << " " << i;
      ++i;
    }
  };
  expectValues("<scale x=\"2\" y=\"2\"/>", {0.5f, 0.5f, 0.6f, 0.4f});
  expectValues("<translate x=\"0.34\"/>", {0.2f, 0.5f, 0.1f, 0.2f});
  expectValues("<rotate z=\"1\" angle=\"30\"/>", {0.1f, 0.6f, 0.5f, 0.3f});
}

TEST(Bitmap, StaysInsideHoweverFarTheCoordinates) {
  Pictures pictures;
  for (const char* wrap : {"repeat", "mirror", "clamp"})
    for (const char* filter : {"nearest", "bilinear"}) {
      const TextureView t = pictures.texture(word("filter_type", filter) + word("wrap_mode", wrap));
      for (const float u : {0.f, 1.f, -1e-9f, 1e9f, -1e9f, 1e30f, -3e37f, 0x1.fffffep-1f}) {
        const float v = t.lookup({u, -u}).g;
        EXPECT_GE(v, 0.1f - 1e-6f) << wrap << " " << u;
        EXPECT_LE(v, 0.6f + 1e-6f) << wrap << " " << u;
      }
    }
}

TEST(Bitmap, BytesAreSrgbUnlessRaw) {
  Pictures pictures;
  writePng(pictures.folder.path() / "grey.png", Image(2, 2, Rgb(0.5f)));
  const float byte = std::round(255 * (1.055f * std::pow(0.5f, 1 / 2.4f) - 0.055f)) / 255;
  EXPECT_NEAR(pictures.texture("", "grey.png").lookup({0.3f, 0.6f}).g, std::pow((byte + 0.055f) / 1.055f, 2.4f), 1e-6f);
  EXPECT_NEAR(pictures.texture("<boolean name=\"raw\" value=\"true\"/>", "grey.png").lookup({0.3f, 0.6f}).g, byte,
              1e-6f);
  EXPECT_NEAR(pictures.texture("").lookup({0.5f / 3, 0.25f}).g, 0.1f, 1e-6f) << "floats are linear anyway";
}

TEST(Bitmap, OfOneColourIsThatColourToTheBit) {
  Pictures pictures;
  pictures.write("flat.exr", Image(5, 3, Rgb(0.1f, 0.7f, 0.3f)));
  const TextureView t = pictures.texture("", "flat.exr");
  for (const Vec2 uv : {Vec2{0.123f, 0.456f}, {0.9f, 0.01f}, {0.3333f, 0.7777f}})
    EXPECT_EQ(t.lookup(uv), Rgb(0.1f, 0.7f, 0.3f));
}

TEST(Checkerboard, HasMitsubasSquares) {
  const auto board = [](const std::string& parameters) {
    return test::build(
        "<emitter type=\"constant\"/><shape type=\"cube\"><bsdf type=\"diffuse\"><texture "
        "name=\"reflectance\" type=\"checkerboard\">" +
        parameters + "</texture></bsdf></shape>");
  };
  const SceneSnapshot plain = board("");
  const TextureView& t = plain->view.textures[0];
  for (const auto& [uv, value] : {std::pair(Vec2{0.1f, 0.1f}, 0.4f),
                                  {{0.6f, 0.1f}, 0.2f},
                                  {{0.6f, 0.6f}, 0.4f},
                                  {{1.2f, 0.1f}, 0.4f},
                                  {{-0.1f, 0.1f}, 0.2f}})
    EXPECT_EQ(t.lookup(uv), Rgb(value)) << uv.x << " " << uv.y;
  const SceneSnapshot scaled = board(
      "<rgb name=\"color0\" value=\"1, 0, 0\"/><float name=\"color1\" value=\"0.5\"/>"
      "<transform name=\"to_uv\"><scale x=\"4\" y=\"2\"/></transform>");
  const TextureView& s = scaled->view.textures[0];
  for (const auto& [uv, first] :
       {std::pair(Vec2{0.1f, 0.1f}, true), {{0.2f, 0.1f}, false}, {{0.1f, 0.3f}, false}, {{0.6f, 0.6f}, true}})
    EXPECT_EQ(s.lookup(uv), first ? Rgb(1, 0, 0) : Rgb(0.5f)) << uv.x << " " << uv.y;
}

// --- Where textures may stand

constexpr const char* kBoard =
    R"( type="checkerboard"><rgb name="color0" value="0.1, 0.2, 0.3"/><rgb name="color1" value="0.4"/></texture>)";

TEST(Textures, StandForEveryColourOfEveryBsdf) {
  struct Row {
    const char* type;
    std::vector<const char*> colors;
  };
  const std::vector<const char*> metal{"eta", "k", "specular_reflectance"},
      glass{"specular_reflectance", "specular_transmittance"};
  const auto boarded = [](const char* type, const char* color) {
    return fmt::format("<shape type=\"rectangle\"><bsdf type=\"{}\"><texture name=\"{}\"{}</bsdf></shape>", type, color,
                       kBoard);
  };
  for (const Row& row : {Row{"diffuse", {"reflectance"}},
                         {"phong", {"diffuse_reflectance", "specular_reflectance"}},
                         {"conductor", metal},
                         {"roughconductor", metal},
                         {"dielectric", glass},
                         {"thindielectric", glass},
                         {"roughdielectric", glass}})
    for (size_t i = 0; i < row.colors.size(); ++i) {
      const SceneSnapshot with = test::build(boarded(row.type, row.colors[i]));
      const SurfaceBsdf& bsdf = with->view.bsdfs[with->view.surfaces[0].bsdf];
      ASSERT_TRUE(bsdf.textured) << row.type << " " << row.colors[i];
      EXPECT_EQ(bsdf.frontTextures.index[i], 0) << row.type << " " << row.colors[i];
      // What it is at a place is what a bsdf of that colour is everywhere.
      const SceneSnapshot plain = test::build(fmt::format(
          "<shape type=\"rectangle\"><bsdf type=\"{}\"><rgb name=\"{}\" value=\"0.1, 0.2, 0.3\"/></bsdf></shape>",
          row.type, row.colors[i]));
      const Bsdf here = bsdfAt(with->view, bsdf.front, bsdf.frontTextures, {0.1f, 0.1f});
      const Bsdf& everywhere = plain->view.bsdfs[plain->view.surfaces[0].bsdf].front;
      EXPECT_FALSE(plain->view.bsdfs[plain->view.surfaces[0].bsdf].textured);
      const Vec3 wo = normalize(Vec3(0.2f, 0.3f, 0.9f)), wi = normalize(Vec3(-0.25f, -0.2f, 0.9f));
      for (const float choice : {0.f, 0.9999f}) {
        const BsdfSample a = here.sample(wo, {0.3f, 0.4f}, choice), b = everywhere.sample(wo, {0.3f, 0.4f}, choice);
        EXPECT_EQ(a.weight, b.weight) << row.type << " " << row.colors[i];
        EXPECT_EQ(a.wi, b.wi) << row.type << " " << row.colors[i];
      }
      EXPECT_EQ(here.value(wo, wi), everywhere.value(wo, wi)) << row.type << " " << row.colors[i];
    }
}

TEST(Textures, HaveTheirOwnSideOfTwoSidedBsdfs) {
  const SceneSnapshot scene = test::build(fmt::format(
      "<shape type=\"rectangle\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/><bsdf type=\"roughconductor\">"
      "<texture name=\"specular_reflectance\"{}</bsdf></bsdf></shape>",
      kBoard));
  const SurfaceBsdf& bsdf = scene->view.bsdfs[0];
  EXPECT_TRUE(bsdf.twoSided && bsdf.textured && !bsdf.frontTextures.any());
  EXPECT_EQ(bsdf.backTextures.index[2], 0);
}

TEST(Textures, MayBeDefinedOnceAndReferredTo) {
  const SceneSnapshot scene = test::build(fmt::format(
      "<texture id=\"board\"{}<shape type=\"cube\"><bsdf type=\"diffuse\"><ref id=\"board\" name=\"reflectance\"/>"
      "</bsdf></shape><shape type=\"disk\"><emitter type=\"area\"><ref id=\"board\" "
      "name=\"radiance\"/></emitter></shape>",
      kBoard));
  EXPECT_EQ(scene->view.textures.size, 1);
  EXPECT_EQ(scene->view.emitters[0].radianceAt({0.1f, 0.1f}), Rgb(0.1f, 0.2f, 0.3f));
}

TEST(Textures, OnLightsCountByTheirMean) {
  Pictures pictures;
  const SceneSnapshot scene = pictures.build(
      "<shape type=\"rectangle\"><emitter type=\"area\"><texture name=\"radiance\" type=\"bitmap\"><string "
      "name=\"filename\" value=\"ramp.exr\"/></texture></emitter></shape>");
  EXPECT_NEAR(scene->view.emitters[0].value.g, 0.35f, 1e-6f);
  EXPECT_EQ(scene->view.emitters[0].area, 4);
  EXPECT_NEAR(scene->view.emitters[0].radianceAt({2.5f / 3, 0.75f}).g, 0.6f, 1e-6f);
}

TEST(Textures, ArePicturesThatAreReadOnce) {
  Pictures pictures;
  const std::string elements =
      "<shape type=\"sphere\" id=\"ball\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\">"
      "<string name=\"filename\" value=\"ramp.exr\"/></texture></bsdf></shape>" +
      std::string(test::kSensor);
  const SceneDescription d = test::describe(elements, pictures.folder.path().string());
  const SceneSnapshot first = buildScene(d), second = buildScene(edited(d, "ball", "radius", 2.0), {}, first);
  EXPECT_EQ(first->parts->cache.pictures, second->parts->cache.pictures);
  EXPECT_EQ(first->parts->cache.pictures.size(), 1u);
}

// --- Errors

void expectError(const Pictures& pictures, const std::string& marked, const std::string& message,
                 const std::string& hint = "") {
  const loading::Marked text("<scene version=\"3.0.0\">\n" + marked + test::kSensor + "\n</scene>");
  const auto error =
      loading::errorOf([&] { buildScene(parseMitsubaXml(text.text, "test.xml", pictures.folder.path().string())); });
  ASSERT_TRUE(error) << "builds: " << marked;
  EXPECT_EQ(error->message(), message);
  EXPECT_EQ(error->details().hint, hint) << error->what();
  EXPECT_EQ(error->details().position.offset, text.offset) << error->what();
  EXPECT_EQ(error->details().position.length, text.length) << error->what();
}

std::string painted(const std::string& file, const std::string& more = "") {
  return fmt::format(
      "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"bitmap\">"
      "<string name=\"filename\" value=\"{}\"/>{}</texture></bsdf></shape>",
      file, more);
}

TEST(Textures, BadPixelsAreCountedAndPlaced) {
  Pictures pictures;
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -0.25f, 1.5f};
  const char* const names[] = {"nan", "inf", "-0.25", "1.5"};
  for (int i = 0; i < 4; ++i) {
    Image image = pictures.ramp;
    image.at(1, 1).g = bad[i];
    image.at(2, 1).b = bad[i];
    pictures.write("bad.exr", image);
    expectError(
        pictures, painted("[[bad.exr]]"),
        fmt::format("the picture has 2 pixels that \"reflectance\" cannot take, the first at (1, 1): 0.5 {} 0.5",
                    names[i]),
        "values must be in [0, 1]");
    const std::string lamp =
        "<shape type=\"sphere\"><emitter type=\"area\"><texture name=\"radiance\" type=\"bitmap\"><string "
        "name=\"filename\" value=\"[[bad.exr]]\"/></texture></emitter></shape>";
    if (i < 3)
      expectError(pictures, lamp,
                  fmt::format("the picture has 2 pixels that \"radiance\" cannot take, the first at (1, 1): 0.5 {} 0.5",
                              names[i]),
                  "values must be finite and at least 0");
  }
}

TEST(Textures, BadFilesAndParametersAreNamed) {
  Pictures pictures;
  expectError(pictures, painted("[[absent.png]]"), "file \"absent.png\" not found");
  expectError(pictures, painted("ramp.exr", word("wrap_mode", "[[repaet]]")),
              "unknown value \"repaet\" of \"wrap_mode\"", "did you mean \"repeat\"?");
  expectError(pictures, painted("ramp.exr", word("filter_type", "[[cubic]]")),
              "unknown value \"cubic\" of \"filter_type\"");
  expectError(pictures, painted("ramp.exr", "<float name=\"[[uscale]]\" value=\"2\"/>"),
              "unknown parameter \"uscale\" of texture \"bitmap\"");
  expectError(
      pictures,
      "<shape type=\"cube\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"[[bitmpa]]\"/></bsdf></shape>",
      "unknown texture type \"bitmpa\"", "did you mean \"bitmap\"?");
  expectError(pictures,
              "<shape type=\"cube\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"checkerboard\">"
              "<rgb name=\"color0\" value=\"[[1, 2, 1]]\"/></texture></bsdf></shape>",
              "\"color0\" is 2; it must be in [0, 1]");
  expectError(pictures, "<emitter type=\"point\"><[[texture]] name=\"intensity\" type=\"checkerboard\"/></emitter>",
              "\"intensity\" cannot be a texture", "give an rgb value");
  expectError(pictures,
              "<shape type=\"cube\"><bsdf type=\"phong\"><float name=\"specular_reflectance\" "
              "value=\"[[0.2]]\"/><texture name=\"diffuse_reflectance\" type=\"checkerboard\">"
              "<float name=\"color0\" value=\"0.9\"/></texture></bsdf></shape>",
              "diffuse and specular reflectance add up to more than 1",
              "the largest values of textures count, wherever they lie");
  pictures.folder.write("broken.png", "\x89PNG\r\n\x1a\nand no more");
  const loading::Marked text("<scene version=\"3.0.0\">\n" + painted("[[broken.png]]") + test::kSensor + "</scene>");
  const auto error =
      loading::errorOf([&] { buildScene(parseMitsubaXml(text.text, "test.xml", pictures.folder.path().string())); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->details().position.offset, text.offset) << error->what();
  EXPECT_NE(error->message().find("broken.png"), std::string::npos) << error->what();
}

}  // namespace
}  // namespace virga
