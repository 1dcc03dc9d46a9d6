// SPDX-License-Identifier: Apache-2.0
// Values at the ends of their ranges and places that lie exactly on something.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/random.h"
#include "core/warp.h"
#include "image/scratch.h"
#include "methods/rendering.h"
#include "transport/media_walk.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr const char* kSky = R"(<emitter type="constant"><rgb name="radiance" value="1"/></emitter>)";

std::string camera(const std::string& origin, const std::string& target) {
  return fmt::format(R"(<sensor type="perspective"><float name="fov" value="60"/>
    <transform name="to_world"><lookat origin="{}" target="{}" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/></film></sensor>)",
                     origin, target);
}
const std::string kFromAfar = camera("0.2, 0.4, 4", "0, 0, 0");

std::string ballOf(const std::string& parameters, const std::string& type = "homogeneous") {
  return fmt::format(R"(<shape type="sphere"><bsdf type="null"/><medium name="interior" type="{}">{}</medium></shape>)",
                     type, parameters);
}
std::string ball(const std::string& sigmaT, const std::string& albedo) {
  return ballOf(fmt::format(R"(<float name="sigma_t" value="{}"/><float name="albedo" value="{}"/>)", sigmaT, albedo));
}

Image pictureOf(const std::string& elements, int passes = 16, uint64_t seed = 1) {
  const RenderSession session = rendered(sceneOf(elements), {.passes = passes, .seed = seed});
  EXPECT_EQ(session.film().nonFiniteSamples(), 0u) << elements;
  return session.film().beauty();
}

stats::Moments means(const std::string& elements, int passes = 64, uint64_t seed = 1) {
  const RenderSession session = rendered(sceneOf(elements), {.passes = passes, .seed = seed});
  EXPECT_EQ(session.film().nonFiniteSamples(), 0u) << elements;
  return replicateMoments(session.film());
}

// --- boundaries of several shapes ---

/// Black fog in a tube with a disk at either end, as wide as it is high.
std::string closedTube(const std::string& media) {
  const std::string bounds = "<bsdf type=\"null\"/>" + media;
  std::string elements =
      "<shape type=\"cylinder\"><point name=\"p0\" x=\"0\" y=\"-1\" z=\"0\"/>"
      "<point name=\"p1\" x=\"0\" y=\"1\" z=\"0\"/>" +
      bounds + "</shape>";
  for (const int end : {1, -1})
    elements += fmt::format(R"(<shape type="disk"><transform name="to_world"><rotate x="1" angle="{}"/>
      <translate y="{}"/></transform>{}</shape>)",
                            -90 * end, end, bounds);
  return elements;
}

TEST(OpenBoundaries, ATubeIsClosedByDisks) {
  const std::string black = R"(<float name="sigma_t" value="1"/><float name="albedo" value="0"/></medium>)";
  const std::string interior = R"(<medium type="homogeneous" name="interior">)" + black;
  const std::string exterior =
      R"(<medium type="homogeneous" name="exterior"><float name="sigma_t" value="0"/></medium>)";
  const auto ray = [](const std::string& origin, const std::string& target, const std::string& medium = "") {
    return fmt::format(R"(<sensor type="perspective"><float name="fov" value="0.001"/>
      <transform name="to_world"><lookat origin="{}" target="{}" up="0, 0, 1"/></transform>
      <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/></film>{}</sensor>)",
                       origin, target, medium);
  };
  const std::string fog = "<medium type=\"homogeneous\">" + black;
  for (const std::string& media : {interior, interior + exterior}) {
    const std::string tube = kSky + closedTube(media);
    // By the side, by the side and an end, by an end and the side, from within, and past it all.
    EXPECT_NEAR(means(tube + ray("2, -1.5, 0", "0, 0, 0")).mean(), std::exp(-2.5f), 0.008);
    EXPECT_NEAR(means(tube + ray("2, -1, 0", "0, 1, 0")).mean(), std::exp(-std::sqrt(2.f)), 0.008);
    EXPECT_NEAR(means(tube + ray("-0.5, 2, 0", "1, 0.5, 0")).mean(), std::exp(-std::sqrt(0.5f)), 0.008);
    EXPECT_NEAR(means(tube + ray("0, 0, 0", "0, 1, 0", fog)).mean(), std::exp(-1.f), 0.008);
    EXPECT_NEAR(means(tube + ray("2, 0, 0", "2, 1, 0.1")).mean(), 1, 1e-6);
  }
}

// --- lights ---

std::string lamp(double intensity) {
  return fmt::format(R"(<emitter type="point"><point name="position" x="2" y="2" z="2"/>
    <rgb name="intensity" value="{}"/></emitter>)",
                     intensity);
}
std::string panel(double radiance) {
  return fmt::format(R"(<shape type="sphere"><point name="center" x="-2" y="1" z="2"/><float name="radius" value="0.3"/>
    <emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>)",
                     radiance);
}

TEST(Robustness, LightsWithoutPowerAreDark) {
  const std::string scene = kFromAfar + ball("2", "0.9");
  const auto dark = [&](const char* type, const char* power) {
    return fmt::format(R"(<emitter type="{}"><rgb name="{}" value="0"/></emitter>)", type, power);
  };
  for (const std::string& lights : {lamp(0), panel(0), lamp(0) + panel(0), dark("spot", "intensity"),
                                    dark("directional", "irradiance"), dark("constant", "radiance")})
    EXPECT_EQ(pixelMoments(pictureOf(scene + lights)).mean(), 0) << lights;
}

TEST(Robustness, LightsWithoutPowerAddNothing) {
  const std::string scene = kFromAfar + ball("2", "0.9") + lamp(30);
  const Image alone = pictureOf(scene);
  EXPECT_GT(pixelMoments(alone).mean(), 0.01);
  EXPECT_EQ(largestDifference(pictureOf(scene + lamp(0)), alone), 0);
}

// Its power overflows single precision, a hundredth of its radiance does not.
TEST(Robustness, TheBrightestLightDoesNotHideTheOthers) {
  const SceneSnapshot scene = sceneOf(kFromAfar + lamp(3e38) + lamp(1.5e38));
  EXPECT_NEAR(scene->view.emitterChoice.probability(0), 2. / 3, 1e-6);
  EXPECT_NEAR(scene->view.emitterChoice.probability(1), 1. / 3, 1e-6);
}

// --- media ---

TEST(Robustness, ABlackMediumAbsorbs) {
  // Through the centre of a ball of radius 1: exp(-2 sigma_t).
  const std::string central = pinpointSensor("0, 0, 4", "0, 0, 0", "0, 1, 0", 4) + kSky;
  EXPECT_NEAR(pixelMoments(pictureOf(central + ball("0.5", "0"), 4096)).mean(), std::exp(-1.), 0.01);
  EXPECT_EQ(pixelMoments(pictureOf(kFromAfar + lamp(30) + ball("2", "0"))).mean(), 0);
}

// A white one: furnace_test.cpp.

TEST(Robustness, AMediumThatIsNotThereIsInvisible) {
  for (const char* sigmaT : {"0", "1e-30"})
    for (const std::string& light : {std::string(kSky), lamp(30), panel(5)}) {
      const std::string scene = kFromAfar + light;
      EXPECT_LT(largestDifference(pictureOf(scene + ball(sigmaT, "0.9")), pictureOf(scene)), 1e-25f) << sigmaT << light;
    }
}

class Grids : public ::testing::Test {
 protected:
  // A ball filled by a grid of one value.
  std::string filled(float value, double scale) const {
    DenseVolume volume;
    volume.nx = volume.ny = volume.nz = 8;
    volume.values.assign(512, value);
    writeVol(file_, volume);
    return ballOf(fmt::format(R"(<float name="albedo" value="0.9"/><float name="scale" value="{}"/>
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="{}"/>
      <transform name="to_world"><translate value="-0.5"/><scale value="2.5"/></transform></volume>)",
                              scale, file_.string()),
                  "heterogeneous");
  }
  const std::filesystem::path file_ = scratchFile("filled.vol");
};

TEST_F(Grids, WithoutDensityAreInvisible) {
  const std::string scene = kFromAfar + kSky;
  const Image empty = pictureOf(scene);
  EXPECT_EQ(largestDifference(pictureOf(scene + filled(0, 3)), empty), 0);
  EXPECT_EQ(largestDifference(pictureOf(scene + filled(3, 0)), empty), 0);
}

// Every tentative collision is real, and ratio tracking ends at the first one.
TEST_F(Grids, AtTheirMajorantAreHomogeneous) {
  for (const std::string& light : {lamp(30), panel(5)}) {
    const std::string scene = kFromAfar + light;
    const stats::Moments grid = means(scene + filled(2, 1), 1024, 1),
                         analytic = means(scene + ball("2", "0.9"), 1024, 2);
    EXPECT_GT(stats::welchTest(grid, analytic), 1e-4) << grid.mean() << " and " << analytic.mean();
    EXPECT_LT(grid.standardError(), 0.01 * grid.mean()) << "a difference of 6 % would be found";
  }
}

// --- exactly on a boundary ---

constexpr const char* kBox = R"(<shape type="cube"><transform name="to_world">{}</transform><bsdf type="null"/>
  <medium name="interior" type="homogeneous"><float name="sigma_t" value="1"/><float name="albedo" value="0.8"/>
  </medium></shape>)";

std::string boxTurned(const std::string& steps) { return fmt::format(fmt::runtime(kBox), steps); }

// The mean of a picture lies between those of its neighbours, give or take what is allowed relative to them.
void expectBetween(double before, double at, double after, double tolerance) {
  EXPECT_GE(at, std::min(before, after) * (1 - tolerance));
  EXPECT_LE(at, std::max(before, after) * (1 + tolerance));
}

TEST(Robustness, ALampOnABoundaryIsJustBesideIt) {
  const auto withLamp = [&](const std::string& light) { return means(kFromAfar + boxTurned("") + light, 1024); };
  const auto point = [&](double y) {
    return withLamp(
        fmt::format(R"(<emitter type="point"><point name="position" x="0.2" y="{}" z="0.1"/></emitter>)", y));
  };
  const auto sheet = [&](double y, int angle) {
    return withLamp(fmt::format(R"(<shape type="rectangle"><transform name="to_world"><scale value="0.4"/>
      <rotate x="1" angle="{}"/><translate y="{}"/></transform><emitter type="area"/></shape>)",
                                angle, y));
  };
  expectBetween(point(0.999).mean(), point(1).mean(), point(1.001).mean(), 0.02);
  for (const int angle : {90, -90})  // shines into the box, and away from it
    expectBetween(sheet(0.999, angle).mean(), sheet(1, angle).mean(), sheet(1.001, angle).mean(), 0.02);
}

// --- meshes ---

class Meshes : public ::testing::Test {
 protected:
  std::string obj(const std::string& text, const std::string& inside) const {
    std::ofstream(file_) << text;
    return fmt::format(R"(<shape type="obj"><string name="filename" value="{}"/>{}</shape>)", file_.string(), inside);
  }
  const std::filesystem::path file_ = scratchFile("mesh.obj");

  static constexpr const char* kCube =
      "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n";
  static constexpr const char* kFaces = "f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n";
  static constexpr const char* kBadlyWound = "f 1 5 7 3\nf 2 4 8 6\nf 5 6 2 1\nf 3 7 8 4\nf 2 4 3 1\nf 5 6 8 7\n";
};

constexpr const char* kMeshFog = R"(<bsdf type="null"/><medium name="interior" type="homogeneous">
  <float name="sigma_t" value="2"/><float name="albedo" value="0.8"/></medium>)";

TEST_F(Meshes, WoundBadlyHoldTheirMediumAllTheSame) {
  const std::string scene = kFromAfar + kSky;
  const Image good = pictureOf(scene + obj(std::string(kCube) + kFaces, kMeshFog));
  const Image bad = pictureOf(scene + obj(std::string(kCube) + kBadlyWound, kMeshFog));
  EXPECT_LT(pixelMoments(good).mean(), 0.95) << "there is something to see";
  EXPECT_LT(largestDifference(good, bad), 1e-4f);
}

// The transmittance along a ray of the camera; homogeneous media make it exact.
float transmittanceAlong(const Scene& scene, const MediaRay& ray) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  Pcg32 random(1);
  MediaRay walked = ray;
  return passMedia(scene.view, rays, walked, kInfinity, random).g;
}
Ray cameraRay(const Scene& scene, Vec3 w) { return {scene.camera.toWorld.translation + w * 0.01f, w}; }
float transmittanceFromCamera(const Scene& scene, Vec3 w) {
  return transmittanceAlong(scene, leaveCamera(scene.view, cameraRay(scene, w)));
}

// Cameras on balls, boxes and meshes, straight ones and turned ones, which are where they are only up to rounding.
TEST_F(Meshes, ACameraOnABoundaryIsJustBesideIt) {
  Pcg32 rng(21);
  int lost = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3 axis = uniformSphere({rng.next(), rng.next()});
    const double angle = i % 4 == 0 ? 0 : 360 * static_cast<double>(rng.next());
    const bool ball = i % 3 == 0, mesh = i % 3 == 1;
    const Affine pose(Matrix4::translation(i % 7, 0.3, 0) * Matrix4::rotation(axis.x, axis.y, axis.z, angle));
    const Vec3 face(1.8f * rng.next() - 0.9f, 1.8f * rng.next() - 0.9f, 1),
        round = uniformSphere({rng.next(), rng.next()});
    const Vec3 p = pose.point(ball ? round : face), n = pose.vector(ball ? round : Vec3(0, 0, 1));
    const std::string fog = fmt::format(
        R"(<transform name="to_world"><rotate x="{}" y="{}" z="{}" angle="{}"/><translate x="{}" y="0.3"/></transform>
        <bsdf type="null"/><medium name="interior" type="homogeneous"><float name="sigma_t" value="1"/></medium>)",
        axis.x, axis.y, axis.z, angle, i % 7);
    const std::string shape = mesh ? obj(std::string(kCube) + kFaces, fog)
                                   : fmt::format("<shape type=\"{}\">{}</shape>", ball ? "sphere" : "cube", fog);
    const auto from = [&](float off) {
      const Vec3 eye = p + n * off;
      return sceneOf(kSky + shape + camera(fmt::format("{}, {}, {}", eye.x, eye.y, eye.z), "9, 8, 7"));
    };
    const SceneSnapshot before = from(-1e-3f), at = from(0), after = from(1e-3f);
    for (int j = 0; j < 50; ++j) {
      const Vec3 w = uniformSphere({rng.next(), rng.next()});
      if (std::fabs(dot(w, n)) < 0.03f) continue;  // along the boundary a thousandth is a long way
      const float a = transmittanceFromCamera(*before, w), b = transmittanceFromCamera(*at, w),
                  c = transmittanceFromCamera(*after, w);
      EXPECT_GE(b, std::min(a, c) - 1e-3f) << i << " " << dot(w, n);
      EXPECT_LE(b, std::max(a, c) + 1e-3f) << i << " " << dot(w, n);
      lost += std::fabs(transmittanceAlong(*at, {cameraRay(*at, w), {}}) - b) > 1e-3f ? 1 : 0;
    }
  }
  EXPECT_GT(lost, 500) << "a camera that knows of no media loses those that it looks into";
}

TEST_F(Meshes, TrianglesWithoutAreaDoNoHarm) {
  const std::string slivers = "v 0 0 1\nv 1e-30 0 1\nv 0 1e-30 1\nf 9 10 11\nf 1 9 1\nf 1 2 2\nv 0 -1 1\nf 5 12 6\n";
  for (const std::string& what :
       {std::string(R"(<bsdf type="diffuse"/>)"), std::string(R"(<emitter type="area"/>)"),
        std::string(R"(<bsdf type="diffuse"/><emitter type="area"/>)"), std::string(kMeshFog)}) {
    const std::string scene = kFromAfar + lamp(10) + ball("0.5", "0.9");
    const Image clean = pictureOf(scene + obj(std::string(kCube) + kFaces, what));
    const Image dirty = pictureOf(scene + obj(std::string(kCube) + kFaces + slivers, what));
    EXPECT_GT(pixelMoments(clean).mean(), 0) << what;
    EXPECT_LT(largestDifference(clean, dirty), 1e-4f) << what;
  }
}

// --- samples that are no numbers ---

/// Bright everywhere, but for one sample of a pass that is not a number and one that is infinite.
class Broken final : public Method {
 public:
  void prepare(SceneSnapshot, const Settings&, LayerMask) override {}
  Reset update(SceneSnapshot, const ChangeSet&) override { return Reset::film; }
  PassResult pass(int64_t index, const Budget&, std::stop_token, PassFrame& frame) override {
    for (int y = 0; y < frame.height(); ++y)
      for (int x = 0; x < frame.width(); ++x) {
        LayerRadiance radiance;
        float value = 1;
        if (index == 1 && x == 2 && y == 1) value = std::nanf("");
        if (index == 2 && x == 0 && y == 3) value = kInfinity;
        radiance.add(Layer::directMedia, Rgb(value));
        frame.set(x, y, radiance);
      }
    return {};
  }
  SettingValues settingsInForce() const override { return {}; }
};

const MethodInfo kBroken{"broken", "for tests", "none", LayerMask::none(), Accuracy::unbiased, {}, [] {
                           return std::unique_ptr<Method>(std::make_unique<Broken>());
                         }};

TEST(Robustness, SamplesThatAreNoNumbersAreCountedAndStayWhereTheyAre) {
  RenderSession session(sceneOf(pinpointSensor("0, 0, 5", "0, 0, 0", "0, 1, 0", 4) + kSky), kBroken, {});
  for (int i = 0; i < 4; ++i) session.step();
  EXPECT_EQ(session.film().nonFiniteSamples(), 2u);
  const Image picture = session.film().beauty();
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) {
      const bool broken = (x == 2 && y == 1) || (x == 0 && y == 3);
      EXPECT_EQ(isFinite(picture.at(x, y)), !broken) << x << " " << y;
    }
}

}  // namespace
}  // namespace virga
