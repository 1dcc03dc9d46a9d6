// SPDX-License-Identifier: Apache-2.0
// Values at the border of what single precision holds: refused or warned of, never silently wrong.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "core/sampler.h"
#include "core/warp.h"
#include "image/image_io.h"
#include "loaders/loading.h"
#include "scene/builder.h"
#include "scene/scene_parts.h"
#include "scene/scenes.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

constexpr const char* kLight = "<emitter type=\"constant\"/>";

/// The message of the error that building gives, or "builds".
std::string failure(const std::string& elements, const std::string& directory = ".") {
  const auto error = loading::errorOf([&] { test::build(kLight + elements, directory); });
  return error ? error->message() : "builds";
}

std::vector<std::string> warnings(const std::string& elements, const std::string& directory = ".") {
  return test::build(kLight + elements, directory)->warnings;
}

std::string fog(const std::string& parameters, const std::string& toWorld = "") {
  return "<shape type=\"sphere\"><bsdf type=\"null\"/><transform name=\"to_world\">" + toWorld +
         "</transform><medium name=\"interior\" type=\"homogeneous\">" + parameters + "</medium></shape>";
}

std::string shape(const std::string& toWorld) {
  return "<shape type=\"rectangle\"><transform name=\"to_world\">" + toWorld + "</transform></shape>";
}

std::string meanCosine(const std::string& g) {
  return fog("<phase type=\"hg\"><float name=\"g\" value=\"" + g + "\"/></phase>");
}

TEST(Limits, RangesHoldForWhatIsKept) {
  EXPECT_EQ(failure(meanCosine("0.99999999")), "\"g\" is 0.99999999, in single precision 1; it must be in (-1, 1)");
  EXPECT_EQ(failure(meanCosine("-0.99999999")), "\"g\" is -0.99999999, in single precision -1; it must be in (-1, 1)");
  EXPECT_EQ(failure(meanCosine("1.5")), "\"g\" is 1.5; it must be in (-1, 1)");
  EXPECT_EQ(failure(meanCosine("0.9999")), "builds");
  EXPECT_EQ(failure("<shape type=\"sphere\"><float name=\"radius\" value=\"1e-60\"/></shape>"),
            "\"radius\" is 1e-60, in single precision 0; it must be greater than 0");
  // A bound that is a parameter itself: 0.7 is 0.7, though the double is above the float.
  EXPECT_EQ(failure("<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"0.7\"/>"
                    "<float name=\"beam_width\" value=\"0.7\"/></emitter>"),
            "builds");
}

TEST(Limits, HomogeneousMediaMustBeTrackableToo) {
  const auto sigmaT = [](const char* value) { return fmt::format("<float name=\"sigma_t\" value=\"{}\"/>", value); };
  EXPECT_EQ(failure(fog(sigmaT("1e8"))), "the medium is 3.5e+08 mean free paths thick; at most 1e+06 can be tracked");
  EXPECT_EQ(failure(fog(sigmaT("1e5"))), "builds");
  EXPECT_EQ(failure(fog(sigmaT("1e8"), "<scale value=\"1e-3\"/>")), "builds") << "small enough";
  EXPECT_EQ(failure(fog(sigmaT("1e5"), "<scale value=\"10\"/>")),
            "the medium is 3.5e+06 mean free paths thick; at most 1e+06 can be tracked");
  EXPECT_NE(failure("<shape type=\"sphere\"><medium name=\"exterior\" type=\"homogeneous\">" + sigmaT("1e8") +
                    "</medium></shape>"),
            "builds");
}

TEST(Limits, TransformsAreSingularByTheirShapeNotByTheirSize) {
  for (const char* good : {"<scale x=\"2e6\"/>", "<scale x=\"1e-5\" y=\"1e6\"/>", "<scale value=\"1e-9\"/>",
                           "<scale x=\"1e5\"/><rotate x=\"1\" y=\"2\" z=\"3\" angle=\"40\"/>"})
    EXPECT_EQ(failure(shape(good)), "builds") << good;
  for (const char* bad : {"<scale x=\"0\"/>", "<matrix value=\"1 2 3 2 4 6 0 0 1\"/>",
                          "<matrix value=\"1 1 0 1 1.0000000000001 0 0 0 1\"/>"})
    EXPECT_EQ(failure(shape(bad)), "the transform \"to_world\" is singular: it flattens space") << bad;
  EXPECT_EQ(failure(shape("<scale value=\"1e-50\"/>")),
            "the transform \"to_world\" is too small for its place: its inverse overflows");
}

TEST(Limits, IndicesAndEnvironmentsStayFinite) {
  const auto metal = [](const char* eta) {
    return fmt::format(
        "<shape type=\"sphere\"><bsdf type=\"conductor\"><float name=\"eta\" value=\"{0}\"/>"
        "<float name=\"k\" value=\"{0}\"/></bsdf></shape>",
        eta);
  };
  EXPECT_EQ(failure(metal("1e30")), "\"eta\" is 1e+30; it must be in [0, 1000000]");
  EXPECT_EQ(failure(metal("100")), "builds");
  const loading::TemporaryFolder folder;
  writeExr(folder.path() / "grey.exr", Image(4, 2));
  Image bright(4, 2);
  for (Rgb& p : bright.pixels) p = Rgb(20.f);
  writeExr(folder.path() / "bright.exr", bright);
  const auto map = [](const char* scale) {
    return fmt::format(
        "<emitter type=\"envmap\"><string name=\"filename\" value=\"bright.exr\"/>"
        "<float name=\"scale\" value=\"{}\"/></emitter>",
        scale);
  };
  const auto alone = [&](const std::string& elements) {
    const auto error = loading::errorOf([&] { test::build(elements, folder.path().string()); });
    return error ? error->message() : "builds";
  };
  EXPECT_EQ(alone(map("1e37")), "the map reaches 20, with its scale 2e+38; it must be at most 1e+30");
  EXPECT_EQ(alone(map("1e6")), "builds");
}

TEST(Limits, PlacesAndSizesThatDrownInRoundingAreWarnedOf) {
  EXPECT_TRUE(warnings(fog("")).empty());
  EXPECT_TRUE(warnings(fog("", "<translate x=\"1000\"/>")).empty());
  for (const char* far : {"1e5", "-1e6"}) {
    const auto said = warnings(fog("", fmt::format("<translate x=\"{}\"/>", far)));
    ASSERT_EQ(said.size(), 1u) << far;
    EXPECT_NE(said[0].find("nearer to the origin"), std::string::npos) << said[0];
  }
  EXPECT_EQ(warnings(fog("") + shape("<scale value=\"1e7\"/>")).size(), 1u) << "a large ground spoils small shapes";
  EXPECT_TRUE(warnings(fog("") + shape("<scale value=\"1e4\"/>")).empty());
  const auto sized = [](const char* size, const char* sigmaT) {
    return fog(fmt::format("<float name=\"sigma_t\" value=\"{}\"/>", sigmaT),
               fmt::format("<scale value=\"{}\"/>", size));
  };
  for (const auto& [size, sigmaT] : {std::pair("1e10", "1e-10"), {"1e-10", "1e10"}}) {
    const auto said = warnings(sized(size, sigmaT));
    ASSERT_EQ(said.size(), 1u) << size;
    EXPECT_NE(said[0].find("unit of length"), std::string::npos) << said[0];
  }
  EXPECT_TRUE(warnings(sized("1e6", "1e-6")).empty());
  EXPECT_TRUE(warnings(sized("1e-6", "1e6")).empty());
}

std::string grid(const std::string& type, const std::string& file, const std::string& more = "") {
  return "<shape type=\"cube\"><bsdf type=\"null\"/><medium name=\"interior\" type=\"heterogeneous\"><volume "
         "name=\"sigma_t\" type=\"" +
         type + "\"><string name=\"filename\" value=\"" + file + "\"/>" + more + "</volume></medium></shape>";
}

DenseVolume cubeOfOnes() { return {2, 2, 2, std::vector<float>(8, 1.f), Matrix4(), "density"}; }

TEST(Limits, ABoxWithoutVolumeIsRefusedWhereItIsUsed) {
  const loading::TemporaryFolder folder;
  writeVol(folder.path() / "good.vol", cubeOfOnes());
  const auto damaged = [&](const std::string& name, float x) {
    std::filesystem::copy_file(folder.path() / "good.vol", folder.path() / name);
    std::fstream file(folder.path() / name, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(4 + 5 * 4 + 3 * 4);  // behind magic, version, type, dimensions, channels: the box's upper x
    file.write(reinterpret_cast<const char*>(&x), sizeof(x));
  };
  damaged("nan.vol", std::numeric_limits<float>::quiet_NaN());
  damaged("flat.vol", -0.5f);
  damaged("infinite.vol", kInfinity);
  const std::string use = "<boolean name=\"use_grid_bbox\" value=\"true\"/>", at = folder.path().string();
  for (const std::string name : {"nan.vol", "flat.vol", "infinite.vol"}) {
    const auto error = loading::errorOf([&] { test::build(kLight + grid("gridvolume", name, use), at); });
    ASSERT_TRUE(error) << name;
    EXPECT_NE(error->message().find("which has no volume"), std::string::npos) << error->what();
    EXPECT_NE(std::string(error->what()).find(name), std::string::npos) << error->what();
    EXPECT_EQ(failure(grid("gridvolume", name), at), "builds") << "nobody asks for the box";
  }
  EXPECT_EQ(failure(grid("gridvolume", "good.vol", use), at), "builds");
}

TEST(Limits, AVolumePluginReadsItsOwnFormats) {
  const loading::TemporaryFolder folder;
  writeVol(folder.path() / "a.vol", cubeOfOnes());
  writeVdb(folder.path() / "a.vdb", cubeOfOnes());
  writeNvdb(folder.path() / "a.nvdb", cubeOfOnes());
  writeVol(folder.path() / "misnamed.vdb", cubeOfOnes());
  const std::string at = folder.path().string();
  for (const auto& [type, file, remedy] : {std::tuple("gridvolume", "a.vdb", "use type=\"vdb\""),
                                           {"gridvolume", "a.nvdb", "use type=\"vdb\""},
                                           {"vdb", "a.vol", "use type=\"gridvolume\""},
                                           {"vdb", "misnamed.vdb", "use type=\"gridvolume\""}}) {
    const auto error = loading::errorOf([&] { test::build(kLight + grid(type, file), at); });
    ASSERT_TRUE(error) << type << " " << file;
    EXPECT_EQ(error->details().hint, remedy) << error->what();
  }
  for (const auto& [type, file] : {std::pair("gridvolume", "a.vol"), {"vdb", "a.vdb"}, {"vdb", "a.nvdb"}})
    EXPECT_EQ(failure(grid(type, file), at), "builds") << type << " " << file;
}

/// Of rays that leave a convex shape outward, from where other rays met it: how many meet it again.
int metAgain(const Scene& scene, float distance, float marginScale) {
  const Vec3 center = scene.view.bounds.center();
  const float size = maxComponent(scene.view.bounds.extent());
  int count = 0;
  for (uint32_t i = 0; i < 20'000; ++i) {
    Sampler sampler(SampleId{1, 0, 0, i});
    const Vec3 inside = center + uniformSphere(sampler.next2D()) * (0.25f * size);
    const Vec3 origin = center + uniformSphere(sampler.next2D()) * (size * distance);
    const Ray ray{origin, normalize(inside - origin)};
    const RayHit hit = scene.surfaceRays->nearest(ray, 0, kInfinity);
    if (!hit.found()) continue;
    SurfacePoint s = surfacePoint(scene.view.surfaces[hit.shape], ray, hit, scene.view.scale);
    s.epsilon *= marginScale;
    Vec3 w = uniformSphere(sampler.next2D());
    if (i % 2 == 0) w = normalize(w - s.geometricNormal * (0.999f * dot(w, s.geometricNormal)));  // grazing
    if (dot(w, s.geometricNormal) * dot(ray.d, s.geometricNormal) > 0) w = -w;                    // back to its side
    count += scene.surfaceRays->nearest({s.originToward(w), w}, 0, kInfinity).found() ? 1 : 0;
  }
  return count;
}

TEST(Limits, RaysThatLeaveASurfaceDoNotMeetItAgain) {
  for (const char* type : {"rectangle", "sphere", "disk", "cube"})
    for (const char* place : {"0", "3", "1e2", "1e4"})
      for (const float distance : {2.f, 100.f}) {
        const SceneSnapshot scene = test::build(
            fmt::format("<shape type=\"{}\"><transform name=\"to_world\"><rotate x=\"1\" y=\"2\" z=\"3\" angle=\"50\"/>"
                        "<translate x=\"{}\" y=\"1\" z=\"-{}\"/></transform></shape>",
                        type, place, place));
        EXPECT_EQ(metAgain(*scene, distance, 0.75f), 0)
            << "with three quarters of the margin: " << type << " at " << place << " from " << distance;
        EXPECT_GT(metAgain(*scene, distance, 0), 0) << "the test cannot fail: " << type << " at " << place;
      }
}

// --- Parameters that ask for what is not done

std::string sensor(const std::string& film, const std::string& sampler = "") {
  return "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><film type=\"hdrfilm\">" + film + "</film>" +
         sampler + "</sensor>" + kLight;
}

TEST(Limits, WhatIsIgnoredIsWarnedOfWhereItMatters) {
  const auto text = [](const char* name, const char* value) {
    return fmt::format("<string name=\"{}\" value=\"{}\"/>", name, value);
  };
  const auto seed = [](int value) {
    return fmt::format("<sampler type=\"independent\"><integer name=\"seed\" value=\"{}\"/></sampler>", value);
  };
  const auto said = [](const std::string& elements) { return buildScene(test::describe(elements))->warnings; };
  for (const auto& [elements, parameter] :
       {std::pair(sensor(text("file_format", "rgbe")), "file_format"),
        {sensor(text("pixel_format", "luminance")), "pixel_format"},
        {sensor(text("component_format", "uint32")), "component_format"},
        {sensor("", seed(3)), "seed"},
        {sensor("") + fog("<boolean name=\"sample_emitters\" value=\"false\"/>"), "sample_emitters"}}) {
    const std::vector<std::string> found = said(elements);
    ASSERT_EQ(found.size(), 1u) << elements;
    EXPECT_NE(found[0].find(fmt::format("warning: \"{}\" is ignored: ", parameter)), std::string::npos) << found[0];
  }
  for (const std::string& elements :
       {sensor(text("file_format", "openexr") + text("pixel_format", "rgb") + text("component_format", "float32")),
        sensor("", seed(0)), sensor("") + fog("<boolean name=\"sample_emitters\" value=\"true\"/>"),
        sensor("") + "<integrator type=\"path\"/>", sensor("") + "<integrator type=\"volpath\"/>" + fog("")})
    EXPECT_TRUE(said(elements).empty()) << elements;
  const std::vector<std::string> media = said(sensor("") + "<integrator type=\"path\"/>" + fog(""));
  ASSERT_EQ(media.size(), 1u);
  EXPECT_NE(media[0].find("integrator \"path\" is ignored"), std::string::npos) << media[0];
}

TEST(Limits, ACropWindowFollowsTheSizeOfTheFilm) {
  const auto sized = [](int width, int height) {
    const auto integer = [](const char* name, int value) {
      return fmt::format("<integer name=\"{}\" value=\"{}\"/>", name, value);
    };
    const std::string film = integer("width", 40) + integer("height", 20) + integer("crop_offset_x", 10) +
                             integer("crop_offset_y", 5) + integer("crop_width", 20) + integer("crop_height", 5);
    return buildScene(test::describe(sensor(film)), {.filmSize = std::pair(width, height)})->camera;
  };
  const PerspectiveCamera twice = sized(80, 40), tiny = sized(2, 2);
  EXPECT_EQ((std::array{twice.filmWidth, twice.filmHeight}), (std::array{80, 40}));
  EXPECT_EQ((std::array{twice.cropX, twice.cropY, twice.width, twice.height}), (std::array{20, 10, 40, 10}));
  EXPECT_GE(std::min(tiny.width, tiny.height), 1);
  EXPECT_LE(tiny.cropX + tiny.width, 2);
  EXPECT_LE(tiny.cropY + tiny.height, 2);
}

TEST(Limits, PhongsDefaultsLeaveRoomForEachOther) {
  const auto phong = [](const std::string& parameters) {
    return "<shape type=\"sphere\"><bsdf type=\"phong\">" + parameters + "</bsdf></shape>";
  };
  EXPECT_EQ(failure(phong("<rgb name=\"diffuse_reflectance\" value=\"0.9\"/>")), "builds");
  EXPECT_EQ(failure(phong("<rgb name=\"diffuse_reflectance\" value=\"0.9\"/><rgb name=\"specular_reflectance\" "
                          "value=\"0.2\"/>")),
            "diffuse and specular reflectance add up to more than 1");
}

TEST(Limits, LampsThatAreNoAreasHaveNoPlaceInAShape) {
  EXPECT_EQ(failure("<emitter type=\"point\" id=\"p\"/><shape type=\"sphere\"><ref id=\"p\"/></shape>"),
            "a point emitter has no place in a shape");
}

}  // namespace
}  // namespace virga
