// SPDX-License-Identifier: Apache-2.0
// What the builder makes of plugins without parameters, and what it says about bad ones, with the place.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "loaders/loading.h"
#include "scene/builder.h"
#include "scene/scene_parts.h"
#include "scene/scenes.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

constexpr const char* kMedium = "<medium name=\"interior\" type=\"homogeneous\"/>";

std::string boundary(const std::string& inside) {
  return "<shape type=\"cube\"><bsdf type=\"null\"/>" + inside + "</shape>";
}
std::string heterogeneous(const std::string& volume) {
  return boundary("<medium name=\"interior\" type=\"heterogeneous\">" + volume + "</medium>");
}

/// Building must fail at the mark `[[...]]` with this message, hint and note; the sensor is added where the text has
/// none.
void expectError(const std::string& marked, const std::string& message, const std::string& hint = "",
                 const std::string& note = "", const std::string& directory = ".") {
  const bool complete = marked.find("<sensor") != std::string::npos || marked.find("[[scene]]") != std::string::npos;
  const std::string head = marked.find("[[scene]]") != std::string::npos ? "" : "<scene version=\"3.0.0\">\n";
  const loading::Marked text(head + marked + (complete ? "" : test::kSensor) + "\n</scene>");
  const auto error = loading::errorOf([&] { buildScene(parseMitsubaXml(text.text, "test.xml", directory)); });
  ASSERT_TRUE(error) << "builds: " << marked;
  EXPECT_EQ(error->message(), message);
  EXPECT_EQ(error->details().hint, hint) << error->what();
  ASSERT_TRUE(error->details().position.known()) << error->what();
  EXPECT_EQ(error->details().position.offset, text.offset) << error->what();
  EXPECT_EQ(error->details().position.length, text.length) << error->what();
  if (!note.empty()) {
    EXPECT_EQ(loading::errorOf([&] { throw *error; })->details().notes, std::vector<std::string>{note})
        << error->what();
  }
}

TEST(Builder, EveryPluginHasDefaults) {
  for (const char* shape : {"cube", "sphere", "rectangle", "disk", "cylinder"}) {
    const SceneSnapshot scene = test::build(fmt::format("<shape type=\"{}\"/>", shape));
    EXPECT_EQ(scene->view.surfaces.size, 1) << shape;
    EXPECT_EQ(scene->view.bsdfs[scene->view.surfaces[0].bsdf].front.kind(), Bsdf::Kind::diffuse);
  }
  for (const char* bsdf :
       {"diffuse", "phong", "conductor", "dielectric", "thindielectric", "roughconductor", "roughdielectric"}) {
    const SceneSnapshot scene = test::build(fmt::format("<shape type=\"sphere\"><bsdf type=\"{}\"/></shape>", bsdf));
    EXPECT_EQ(scene->view.surfaces.size, 1) << bsdf;
  }
  for (const char* emitter : {"point", "spot", "directional", "constant"}) {
    const SceneSnapshot scene = test::build(fmt::format("<emitter type=\"{}\"/>", emitter));
    EXPECT_EQ(scene->view.emitters.size, 1) << emitter;
    EXPECT_EQ(scene->view.emitters[0].value, Rgb(1.f)) << emitter;
  }
  for (const char* medium : {"homogeneous", "heterogeneous"}) {
    const SceneSnapshot scene = test::build(boundary(fmt::format("<medium name=\"interior\" type=\"{}\"/>", medium)));
    ASSERT_EQ(scene->view.media.size, 1) << medium;
    EXPECT_EQ(scene->view.media[0].sigmaT, 1) << medium;
    EXPECT_EQ(scene->view.media[0].albedo, Rgb(0.75f)) << medium;
    EXPECT_TRUE(scene->view.media[0].phase.get<Isotropic>());
    EXPECT_EQ(scene->view.boundaries.size, 1);
  }
  for (const char* phase : {"isotropic", "hg", "cornette_shanks", "rayleigh", "schlick"})
    EXPECT_NO_THROW(test::build(
        boundary(fmt::format("<medium name=\"interior\" type=\"homogeneous\"><phase type=\"{}\"/></medium>", phase))));
  const SceneSnapshot scene = test::build("<integrator type=\"volpath\"/><emitter type=\"constant\"/>");
  EXPECT_EQ(scene->camera.filmWidth, 768);
  EXPECT_EQ(scene->camera.filmHeight, 576);
  EXPECT_EQ(scene->filter.kind, PixelFilter::Kind::gaussian);
  EXPECT_EQ(scene->filter.radius, 2);
  EXPECT_EQ(scene->integrator.maxDepth, -1);
  EXPECT_EQ(scene->integrator.sampleCount, 16);
  EXPECT_TRUE(scene->warnings.empty());
}

TEST(Builder, UnknownPluginsAreNamedWithWhatIsThere) {
  expectError(boundary("<medium name=\"interior\" type=\"[[homogenous]]\"/>"), "unknown medium type \"homogenous\"",
              "did you mean \"homogeneous\"?", "available: heterogeneous, homogeneous");
  expectError("<shape type=\"[[spere]]\"/>", "unknown shape type \"spere\"", "did you mean \"sphere\"?",
              "available: cube, cylinder, disk, obj, ply, rectangle, sphere");
  expectError("<emitter type=\"[[spott]]\"/>", "unknown emitter type \"spott\"", "did you mean \"spot\"?");
  expectError("<shape type=\"cube\"><bsdf type=\"[[defuse]]\"/></shape>", "unknown bsdf type \"defuse\"",
              "did you mean \"diffuse\"?");
  expectError("<integrator type=\"[[volpth]]\"/>", "unknown integrator type \"volpth\"", "did you mean \"volpath\"?");
  expectError(heterogeneous("<volume name=\"sigma_t\" type=\"[[gridvolum]]\"/>"), "unknown volume type \"gridvolum\"",
              "did you mean \"gridvolume\"?");
  expectError("<sensor type=\"[[perspektive]]\"/>", "unknown sensor type \"perspektive\"",
              "did you mean \"perspective\"?");
}

TEST(Builder, PluginsOfTheFutureAreNotUnknown) {
  expectError("<shape type=\"[[gltf]]\"/>", "shape type \"gltf\" is not supported yet", "",
              "available: cube, cylinder, disk, obj, ply, rectangle, sphere");
  expectError("<sensor type=\"[[thinlens]]\"/>", "sensor type \"thinlens\" is not supported yet");
  expectError("<emitter type=\"[[projector]]\"/>", "emitter type \"projector\" is not supported yet");
  expectError("<shape type=\"cube\"><bsdf type=\"[[roughplastic]]\"/></shape>",
              "bsdf type \"roughplastic\" is not supported yet");
  expectError(
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><film type=\"hdrfilm\"><rfilter "
      "type=\"[[lanczos]]\"/>"
      "</film></sensor>",
      "rfilter type \"lanczos\" is not supported yet");
  expectError(
      "<shape type=\"cube\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"[[volume]]\"/></bsdf></shape>",
      "texture type \"volume\" is not supported yet", "", "available: bitmap, checkerboard");
}

TEST(Builder, UnknownParametersAreNamedWithWhatIsThere) {
  expectError("<shape type=\"sphere\"><float name=\"[[radios]]\" value=\"1\"/></shape>",
              "unknown parameter \"radios\" of shape \"sphere\"", "did you mean \"radius\"?");
  expectError(
      boundary("<medium name=\"interior\" type=\"homogeneous\"><float name=\"[[sigmat]]\" value=\"1\"/></medium>"),
      "unknown parameter \"sigmat\" of medium \"homogeneous\"", "did you mean \"sigma_t\"?");
  expectError("<emitter type=\"point\"><float name=\"[[radiance]]\" value=\"1\"/></emitter>",
              "unknown parameter \"radiance\" of emitter \"point\"", "");
}

TEST(Builder, LenientTurnsUnknownParametersIntoWarnings) {
  const SceneDescription d =
      test::describe(std::string("<shape type=\"sphere\"><float name=\"radios\" value=\"1\"/><string name=\"colour\" "
                                 "value=\"red\"/></shape><emitter type=\"constant\"/>") +
                     test::kSensor);
  const SceneSnapshot scene = buildScene(d, {.filmSize = {}, .lenient = true});
  ASSERT_EQ(scene->warnings.size(), 2u);
  EXPECT_EQ(scene->warnings[0].substr(0, scene->warnings[0].find('\n')),
            "test.xml:2:35: warning: unknown parameter \"radios\" of shape \"sphere\"");
  EXPECT_THROW(buildScene(d), Error);
  const SceneDescription bad = test::describe(
      std::string("<shape type=\"sphere\"><float name=\"radius\" value=\"-1\"/></shape>") + test::kSensor);
  EXPECT_THROW(buildScene(bad, {.filmSize = {}, .lenient = true}), Error) << "lenience does not make up for bad values";
}

// As in Mitsuba 3: a constant extinction is a grid of one voxel. A colour is no volume, and homogeneous media have no
// extent.
TEST(Builder, AConstantExtinctionFillsItsUnitCube) {
  const auto view = [](const std::string& type) {
    const SceneSnapshot scene = test::build(
        boundary("<medium name=\"interior\" type=\"" + type +
                 "\"><volume name=\"sigma_t\" type=\"constvolume\"><rgb name=\"value\" "
                 "value=\"1, 2, 4\"/><transform name=\"to_world\"><scale value=\"2\"/></transform></volume></medium>"));
    return std::pair(scene, scene->view.media[0]);
  };
  const auto [scene, medium] = view("heterogeneous");
  EXPECT_EQ(medium.sigmaTAt({1.9f, 0.1f, 1}), Rgb(1, 2, 4));
  EXPECT_EQ(medium.sigmaTAt({2.1f, 0.1f, 1}), Rgb());
  const auto [everywhere, same] = view("homogeneous");
  EXPECT_EQ(same.sigmaTAt({2.1f, 0.1f, 1}), Rgb(1, 2, 4));
}

TEST(Builder, ValuesOutOfRange) {
  const auto inMedium = [](const std::string& p) {
    return boundary("<medium name=\"interior\" type=\"homogeneous\">" + p + "</medium>");
  };
  expectError(inMedium("<float name=\"albedo\" value=\"[[1.01]]\"/>"), "\"albedo\" is 1.01; it must be in [0, 1]");
  expectError(inMedium("<rgb name=\"albedo\" value=\"[[0.5, 2, 0.5]]\"/>"), "\"albedo\" is 2; it must be in [0, 1]");
  expectError(inMedium("<float name=\"sigma_t\" value=\"[[-1]]\"/>"), "\"sigma_t\" is -1; it must be at least 0");
  expectError(inMedium("<rgb name=\"emission\" value=\"[[1, -2, 3]]\"/>"), "\"emission\" is -2; it must be at least 0");
  for (const char* g : {"1", "-1", "1.5"})
    expectError(inMedium(fmt::format("<phase type=\"hg\"><float name=\"g\" value=\"[[{}]]\"/></phase>", g)),
                fmt::format("\"g\" is {}; it must be in (-1, 1)", g));
  expectError(
      "<shape type=\"cube\"><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"[[1.5]]\"/></bsdf></shape>",
      "\"reflectance\" is 1.5; it must be in [0, 1]");
  expectError("<shape type=\"sphere\"><float name=\"radius\" value=\"[[0]]\"/></shape>",
              "\"radius\" is 0; it must be greater than 0");
  expectError("<shape type=\"sphere\"><float name=\"radius\" value=\"[[1e40]]\"/></shape>", "\"radius\" is too large");
  expectError("<shape type=\"sphere\"><string name=\"radius\" value=\"[[wide]]\"/></shape>",
              "\"radius\" must be a float, not a string");
  expectError("<emitter type=\"directional\"><[[vector]] name=\"direction\" x=\"0\" y=\"0\" z=\"0\"/></emitter>",
              "\"direction\" has no length");
}

TEST(Builder, Films) {
  const auto film = [](const std::string& p) {
    return "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><film type=\"hdrfilm\">" + p +
           "</film></sensor>";
  };
  expectError(film("<integer name=\"width\" value=\"[[0]]\"/>"), "\"width\" is 0; it must be in [1, 65536]");
  expectError(film("<integer name=\"height\" value=\"[[-5]]\"/>"), "\"height\" is -5; it must be in [1, 65536]");
  expectError(film("<integer name=\"width\" value=\"100\"/><integer name=\"crop_width\" value=\"[[101]]\"/>"),
              "the crop window leaves the film, which is 100 pixels wide");
  expectError("<sensor type=\"perspective\"><float name=\"fov\" value=\"[[180]]\"/></sensor>",
              "\"fov\" is 180; it must be in (0, 180)");
  expectError(
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><float name=\"near_clip\" value=\"5\"/>"
      "<float name=\"far_clip\" value=\"[[2]]\"/></sensor>",
      "\"far_clip\" must be greater than \"near_clip\"");
}

TEST(Builder, OneSensorNoLess) {
  expectError("<[[scene]] version=\"3.0.0\">", "the scene has no sensor", "add a <sensor type=\"perspective\">");
  expectError(
      std::string(test::kSensor) + "\n<[[sensor]] type=\"perspective\"><float name=\"fov\" value=\"20\"/></sensor>",
      "the scene has 2 sensors", "keep one of them");
}

TEST(Builder, Transforms) {
  const auto placed = [](const std::string& shape, const std::string& t) {
    return fmt::format("<shape type=\"{}\">{}</shape>", shape, t);
  };
  for (const char* shape : {"cube", "sphere", "rectangle", "disk", "cylinder"}) {
    const SceneDescription d = test::describe(
        placed(shape, "<transform name=\"to_world\"><scale x=\"1\" y=\"0\" z=\"1\"/></transform>") + test::kSensor);
    const auto error = loading::errorOf([&] { buildScene(d); });
    ASSERT_TRUE(error) << shape;
    EXPECT_EQ(error->message(), "the transform \"to_world\" is singular: it flattens space");
    EXPECT_EQ(error->details().position.line(), 2);
  }
  const SceneDescription uneven = test::describe(
      placed("sphere", "<transform name=\"to_world\"><scale x=\"1\" y=\"2\" z=\"1\"/></transform>") + test::kSensor);
  const auto error = loading::errorOf([&] { buildScene(uneven); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->message(), "a sphere's transform must scale evenly and not shear");
  EXPECT_EQ(error->details().hint, "use a mesh for an ellipsoid or ellipse");
  // The loader refuses a camera that looks along its own up.
  const auto up = loading::errorOf([] {
    test::describe(
        "<sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0, 0, 0\" target=\"0, 5, 0\" "
        "up=\"0, 1, 0\"/></transform></sensor>");
  });
  ASSERT_TRUE(up);
  EXPECT_EQ(up->message(), "\"up\" must not be zero or point along the line of sight");
}

TEST(Builder, Emitters) {
  expectError("<emitter type=\"[[area]]\"/>", "an area emitter belongs inside a shape");
  expectError("<emitter type=\"constant\"/>\n<emitter type=\"[[constant]]\"/>", "the scene has a second environment",
              "keep one constant or envmap emitter");
  expectError("<shape type=\"[[cube]]\"><bsdf type=\"null\"/><emitter type=\"area\"/></shape>",
              "an area emitter on a shape with a null bsdf is not supported yet");
}

TEST(Builder, MissingFilesAreLookedForInFoldersThatAreNamed) {
  const loading::TemporaryFolder folder;
  expectError("<shape type=\"obj\"><string name=\"filename\" value=\"[[bunny.obj]]\"/></shape>",
              "file \"bunny.obj\" not found", "", "looked in " + folder.path().string(), folder.path().string());
  expectError("<shape type=\"ply\"><string name=\"filename\" value=\"[[/no/such.ply]]\"/></shape>",
              "file \"/no/such.ply\" not found");
  expectError("<shape type=\"[[obj]]\"/>", "\"filename\" is missing");
  expectError("<emitter type=\"envmap\"><string name=\"filename\" value=\"[[sky.exr]]\"/></emitter>",
              "file \"sky.exr\" not found");
}

DenseVolume smallVolume() {
  DenseVolume v{2, 2, 2, {0, 1, 2, 3, 4, 5, 6, 7}, Matrix4(), "density"};
  return v;
}

TEST(Builder, BrokenVolumesAreBlamedOnTheirPlaceInTheScene) {
  const loading::TemporaryFolder folder;
  writeVdb(folder.path() / "smoke.vdb", smallVolume());
  const auto volume = [](const std::string& file, const std::string& more) {
    return heterogeneous(fmt::format(
        "<volume name=\"sigma_t\" type=\"vdb\"><string name=\"filename\" value=\"{}\"/>{}</volume>", file, more));
  };
  const auto failure = [&](const std::string& elements) {
    const auto error = loading::errorOf([&] { test::build(elements, folder.path().string()); });
    return error ? std::string(error->what()) : "builds";
  };
  EXPECT_EQ(failure(volume("smoke.vdb", "")), "builds");
  const std::string absent = failure(volume("smoke.vdb", "\n<string name=\"grid\" value=\"temperature\"/>"));
  EXPECT_TRUE(absent.starts_with("test.xml:3:28: error: ")) << absent;
  EXPECT_NE(absent.find("temperature"), std::string::npos) << absent;
  EXPECT_NE(absent.find("density"), std::string::npos) << "what is there: " << absent;

  DenseVolume nan = smallVolume();
  nan.values[5] = std::numeric_limits<float>::quiet_NaN();
  writeVol(folder.path() / "nan.vol", nan);
  const std::string broken = failure(heterogeneous(
      "<volume name=\"sigma_t\" type=\"gridvolume\">\n<string name=\"filename\" value=\"nan.vol\"/></volume>"));
  EXPECT_TRUE(broken.starts_with("test.xml:3:32: error: ")) << broken;
  EXPECT_NE(broken.find("NaN"), std::string::npos) << broken;
  EXPECT_NE(broken.find("(1, 0, 1)"), std::string::npos) << "where: " << broken;

  const std::string notAVolume = failure(volume("text.vdb", ""));
  EXPECT_NE(notAVolume.find("file \"text.vdb\" not found"), std::string::npos) << notAVolume;
  folder.write("text.vdb", "not a volume at all");
  const std::string wrongMagic = failure(volume("text.vdb", ""));
  EXPECT_TRUE(wrongMagic.starts_with("test.xml:2:")) << wrongMagic;
  EXPECT_NE(wrongMagic.find("text.vdb"), std::string::npos) << wrongMagic;

  DenseVolume bright = smallVolume();
  writeVol(folder.path() / "bright.vol", bright);
  EXPECT_NE(
      failure(
          heterogeneous(
              "<volume name=\"albedo\" type=\"gridvolume\"><string name=\"filename\" value=\"bright.vol\"/></volume>"))
          .find("error: albedo reaches 7; it must be at most 1"),
      std::string::npos);
}

TEST(Builder, WhatMakesAPictureBlackIsWarnedOf) {
  EXPECT_EQ(test::build("<shape type=\"sphere\"/>")->warnings,
            std::vector<std::string>{"warning: nothing in the scene shines: its picture is black"});
}

TEST(Builder, LampsWhoseLightMirrorsAndGlassThrowUnseenAreWarnedOf) {
  const auto warnings = [](const std::string& emitter, const std::string& bsdf) {
    return test::build("<emitter type=\"" + emitter + "\"/><shape type=\"sphere\"><bsdf type=" + bsdf +
                       "/bsdf></shape>")
        ->warnings;
  };
  const std::string mirror = R"("conductor"><)", glass = R"("dielectric"><)", pane = R"("thindielectric"><)",
                    twoSided = R"("twosided"><bsdf type="conductor"/><)",
                    behind = R"("twosided"><bsdf type="diffuse"/><bsdf type="conductor"/><)";
  for (const std::string& bsdf : {mirror, glass, pane, twoSided, behind}) {
    for (const char* lamp : {"point", "spot", "directional"}) {
      const std::vector<std::string> found = warnings(lamp, bsdf);
      ASSERT_EQ(found.size(), 1u) << lamp << bsdf;
      for (const char* word : {"mirror", "path", "ims", "caustic_*", "surface_to_*", "media_to_*", "small area"})
        EXPECT_NE(found[0].find(word), std::string::npos) << word;
    }
    EXPECT_TRUE(warnings("constant", bsdf).empty()) << bsdf;
  }
  for (const char* bsdf : {R"("diffuse"><)", R"("roughconductor"><float name="alpha" value="0"/><)"})
    EXPECT_TRUE(warnings("point", bsdf).empty()) << bsdf;
}

TEST(Builder, ObjectsThatAreOnlyReferredToMayStandAnywhere) {
  const SceneSnapshot scene = test::build(
      "<emitter type=\"area\" id=\"glow\"/><phase type=\"hg\" id=\"forward\"><float name=\"g\" value=\"0.5\"/></phase>"
      "<shape type=\"sphere\"><ref id=\"glow\"/></shape><shape type=\"cube\"><bsdf type=\"null\"/><medium "
      "name=\"interior\" "
      "type=\"homogeneous\"><ref id=\"forward\"/></medium></shape>");
  EXPECT_EQ(scene->view.emitters.size, 1);
  EXPECT_EQ(scene->view.media[0].phase, PhaseFunction(HenyeyGreenstein{0.5f}));
}

TEST(Builder, ASensorWithoutAngleHasTheLensOf50Millimetres) {
  const SceneSnapshot scene = buildScene(test::describe("<sensor type=\"perspective\"/><emitter type=\"constant\"/>"));
  const float diagonal = std::sqrt(square(scene->camera.tanX) + square(scene->camera.tanY));
  EXPECT_NEAR(diagonal, std::sqrt(36.f * 36 + 24 * 24) / 100, 1e-5f);
}

TEST(Builder, ManyOverlappingVolumesAreWarnedOf) {
  const auto boxes = [](int count, float step) {
    std::string text = "<emitter type=\"constant\"/>";
    for (int i = 0; i < count; ++i)
      text += fmt::format(
          "<shape type=\"cube\"><bsdf type=\"null\"/>{}<transform name=\"to_world\"><translate x=\"{}\" y=\"{}\" "
          "z=\"0\"/>"
          "</transform></shape>",
          kMedium, step * static_cast<float>(i), 0.1 * i);
    return text;
  };
  EXPECT_TRUE(test::build(boxes(8, 0.1f))->warnings.empty());
  const SceneSnapshot crowded = test::build(boxes(12, 0.1f));
  ASSERT_EQ(crowded->warnings.size(), 1u);
  EXPECT_EQ(crowded->warnings[0],
            "warning: more than 8 volumes may overlap; where more than 8 do, the others are left out");
  EXPECT_TRUE(test::build(boxes(200, 2))->warnings.empty()) << "a row of volumes that touch";
}

// --- Sharing

const char* const kShared = R"(
  <shape type="cube" id="box"><bsdf type="null"/>
    <medium name="interior" type="heterogeneous" id="fog">
      <volume name="sigma_t" type="vdb" id="density"><string name="filename" value="smoke.vdb"/></volume>
      <float name="scale" value="2"/>
    </medium>
  </shape>
  <shape type="rectangle" id="floor"><bsdf type="diffuse" id="paint"><rgb name="reflectance" value="0.5"/></bsdf></shape>
  <shape type="sphere" id="ball"/>
  <shape type="disk" id="lamp"><emitter type="area" id="light"><rgb name="radiance" value="1"/></emitter></shape>
  <emitter type="point" id="bulb"><point name="position" x="0" y="0" z="3"/></emitter>
  <sensor type="perspective" id="camera"><float name="fov" value="40"/>
    <film type="hdrfilm" id="film"><integer name="width" value="32"/><integer name="height" value="32"/></film></sensor>)";

struct Shared {
  loading::TemporaryFolder folder;
  SceneDescription description;
  SceneSnapshot scene;

  Shared() {
    writeVdb(folder.path() / "smoke.vdb", smallVolume());
    description = test::describe(kShared, folder.path().string());
    scene = buildScene(description);
  }
  SceneSnapshot after(std::string_view id, std::string_view property, Value value) const {
    return buildScene(edited(description, id, property, std::move(value)), {}, scene);
  }
};

TEST(Sharing, AnEditKeepsWhatItDoesNotTouch) {
  const Shared shared;
  const Scene::Parts& before = *shared.scene->parts;
  const SceneSnapshot moved = shared.after("ball", "radius", 2.0);
  const Scene::Parts& after = *moved->parts;
  ASSERT_EQ(after.surfaceShapes.size(), 3u);
  EXPECT_EQ(before.surfaceShapes[0], after.surfaceShapes[0]);
  EXPECT_NE(before.surfaceShapes[1], after.surfaceShapes[1]);
  EXPECT_EQ(before.surfaceShapes[2], after.surfaceShapes[2]);
  EXPECT_EQ(before.boundaryShapes, after.boundaryShapes);
  EXPECT_EQ(before.cache.grids, after.cache.grids);
  EXPECT_EQ(before.cache.grids.size(), 1u);
  EXPECT_EQ(moved->view.surfaces[1].radius, 2);

  const SceneSnapshot thicker = shared.after("fog", "scale", 5.0);
  EXPECT_EQ(thicker->view.media[0].sigmaT, 5);
  EXPECT_EQ(thicker->parts->surfaceShapes, before.surfaceShapes);
  EXPECT_EQ(thicker->parts->cache.grids, before.cache.grids);
  const SceneSnapshot painted = shared.after("paint", "reflectance", Rgb(0.1f));
  EXPECT_EQ(painted->parts->surfaceShapes, before.surfaceShapes);
}

TEST(Sharing, ABadParameterIsFoundThoughTheShapeIsKnown) {
  const Shared shared;
  EXPECT_THROW(shared.after("ball", "radios", 2.0), Error);
  EXPECT_THROW(shared.after("ball", "radius", -2.0), Error);
}

TEST(Sharing, AChangedFileIsReadAgain) {
  const Shared shared;
  DenseVolume other = smallVolume();
  other.values[0] = 99;
  writeVdb(shared.folder.path() / "smoke.vdb", other);
  std::filesystem::last_write_time(shared.folder.path() / "smoke.vdb",
                                   std::filesystem::file_time_type::clock::now() + std::chrono::seconds(5));
  const SceneSnapshot next = buildScene(shared.description, {}, shared.scene);
  EXPECT_EQ(next->parts->cache.grids.begin()->second->maximum(), 99);
  EXPECT_EQ(shared.scene->parts->cache.grids.begin()->second->maximum(), 7);
}

TEST(Sharing, ASnapshotOutlivesItsPredecessor) {
  Shared shared;
  SceneSnapshot next = shared.after("camera", "fov", 20.0);
  shared.scene.reset();
  EXPECT_EQ(next->view.media[0].density.lookup({1, 1, 1}), 7);
  EXPECT_TRUE(next->surfaceRays->nearest({{0.5f, 0.5f, 4}, {0, 0, -1}}, 0, kInfinity).found());
}

TEST(Differences, HaveTheRightAspects) {
  const Shared shared;
  const auto changes = [&](std::string_view id, std::string_view property, Value value) {
    return differences(shared.description, edited(shared.description, id, property, std::move(value))).changes;
  };
  const auto only = [](const char* id, Aspect aspect) { return std::vector<Change>{{id, aspect}}; };
  EXPECT_EQ(changes("camera", "fov", 20.0), only("camera", Aspect::camera));
  EXPECT_EQ(changes("film", "width", int64_t{64}), only("film", Aspect::film));
  EXPECT_EQ(changes("bulb", "intensity", Rgb(2.f)), only("bulb", Aspect::emitterIntensity));
  EXPECT_EQ(changes("bulb", "position", Vec3(1.f)), only("bulb", Aspect::emitterPose));
  EXPECT_EQ(changes("light", "radiance", Rgb(2.f)), only("light", Aspect::emitterIntensity));
  EXPECT_EQ(changes("fog", "scale", 3.0), only("fog", Aspect::mediumParameters));
  EXPECT_EQ(changes("density", "filename", std::string("fire.vdb")), only("density", Aspect::mediumGrid));
  EXPECT_EQ(changes("density", "to_world", Matrix4::scaling(2, 2, 2)), only("density", Aspect::mediumPose));
  EXPECT_EQ(changes("ball", "to_world", Matrix4::scaling(2, 2, 2)), only("ball", Aspect::shapePose));
  EXPECT_EQ(changes("ball", "flip_normals", true), only("ball", Aspect::shapeTopology));
  EXPECT_EQ(changes("paint", "reflectance", Rgb(0.2f)), only("paint", Aspect::material));
  EXPECT_TRUE(changes("fog", "scale", 2.0).empty()) << "the same value";
  EXPECT_TRUE(differences(shared.description, shared.description).empty());
}

TEST(Differences, OfTheSetOfEmitters) {
  const Shared shared;
  const SceneDescription more =
      test::describe(std::string(kShared) + "<emitter type=\"point\" id=\"second\"/>", shared.folder.path().string());
  const ChangeSet set = differences(shared.description, more);
  ASSERT_EQ(set.changes.size(), 1u);
  EXPECT_EQ(set.changes[0], (Change{"second", Aspect::emitterSet}));
  EXPECT_TRUE(differences(more, shared.description).touches(Aspect::emitterSet));
  EXPECT_FALSE(set.touches(Aspect::camera));
}

// --- Where the camera is

TEST(CameraMedia, AreThoseOfTheVolumesAroundIt) {
  const std::string cubes =
      boundary(kMedium) +
      "<shape type=\"cube\"><bsdf type=\"null\"/><transform name=\"to_world\"><translate x=\"5\"/>"
      "</transform><medium name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" "
      "value=\"2\"/></medium></shape>";
  const auto at = [&](double x, const std::string& medium = "") {
    return buildScene(
        test::describe(cubes + fmt::format("<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/>{}"
                                           "<transform name=\"to_world\"><translate x=\"{}\"/></transform></sensor>",
                                           medium, x)));
  };
  EXPECT_EQ(at(0)->view.cameraMedia.count(), 1);
  EXPECT_EQ(at(0)->view.media[at(0)->view.cameraMedia.medium(0)].sigmaT, 1);
  EXPECT_EQ(at(5)->view.media[at(5)->view.cameraMedia.medium(0)].sigmaT, 2);
  EXPECT_TRUE(at(2.5)->view.cameraMedia.vacuum());
  EXPECT_EQ(at(0, "<medium type=\"homogeneous\"/>")->view.cameraMedia.count(), 1)
      << "the same medium, declared twice, counts once";
  EXPECT_EQ(at(2.5, "<medium type=\"homogeneous\"/>")->view.cameraMedia.count(), 1);
}

// A bubble in a bowl of fluid: outside the bowl, the bubble's declared exterior is not what surrounds the camera.
TEST(CameraMedia, StopAtSurfaces) {
  const char* const scene = R"(
    <medium type="homogeneous" id="fluid"><float name="sigma_t" value="3"/></medium>
    <shape type="sphere"><bsdf type="dielectric"/><ref name="interior" id="fluid"/></shape>
    <shape type="sphere"><float name="radius" value="0.5"/><bsdf type="null"/><medium name="interior" type="homogeneous"/>
      <ref name="exterior" id="fluid"/></shape>
    <sensor type="perspective"><float name="fov" value="40"/>
      <transform name="to_world"><translate x="{0}" y="{0}" z="{0}"/></transform></sensor>)";
  const auto sigmaAt = [&](double x) {
    std::string text = scene;
    for (size_t i = text.find("{0}"); i != std::string::npos; i = text.find("{0}"))
      text.replace(i, 3, fmt::format("{}", x));
    const SceneSnapshot built = buildScene(test::describe(text));
    const MediaState& media = built->view.cameraMedia;
    return media.vacuum() ? 0.f : built->view.media[media.medium(0)].sigmaT;
  };
  EXPECT_EQ(sigmaAt(-4), 0);
  EXPECT_EQ(sigmaAt(4), 0);
  EXPECT_EQ(sigmaAt(0), 1);
  EXPECT_EQ(sigmaAt(-0.45), 3);
  EXPECT_EQ(sigmaAt(0.45), 3);
}

}  // namespace
}  // namespace virga
