// SPDX-License-Identifier: Apache-2.0
// Every lamp lights each frame of instant multiple scattering.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>

#include "image/scratch.h"
#include "methods/instant_scattering/lamp_places.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr Layer kDirect[] = {Layer::directSurface, Layer::directMedia};

constexpr const char* kCamera = R"(
    <sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
      <lookat origin="0.3, 0.3, 4" target="0, -0.1, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="24"/><rfilter type="box"/></film>
    </sensor>)";

/// A ball over a floor, in a box of fog.
std::string fogBox(const std::string& lamps) {
  return lamps + kCamera + R"(
    <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>
      <translate y="-1"/></transform><bsdf type="diffuse"/></shape>
    <shape type="sphere"><float name="radius" value="0.4"/><bsdf type="diffuse"/></shape>
    <shape type="cube"><bsdf type="null"/><transform name="to_world"><scale x="2.2" y="0.9" z="1.4"/></transform>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="0.3"/><float name="albedo" value="0.9"/>
      </medium></shape>)";
}
/// A ball of nothing but fog.
std::string fogBall(const std::string& lamps, double density) {
  return lamps + kCamera +
         fmt::format(R"(
    <shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous">
      <rgb name="sigma_t" value="{}, {}, {}"/><float name="albedo" value="0.9"/></medium></shape>)",
                     density, density, 0.7 * density);
}
/// Number k of some in a row, through the fog and above it.
std::string pointLamp(int k, int of) {
  return fmt::format(R"(<emitter type="point"><point name="position" x="{}" y="{}" z="{}"/>
                       <rgb name="intensity" value="{}"/></emitter>)",
                     -1.8 + 3.6 * k / (of - 1), k % 2 ? 1.3 : 0.6, k % 3 - 1, 2.4 / of);
}
std::string pointLamps(int count) {
  std::string all;
  for (int k = 0; k < count; ++k) all += pointLamp(k, count);
  return all;
}

RenderSession frame(const std::string& elements, int passes = 1) {
  const SettingValues settings{{"mode", "frame"}, {"max_depth", "2"}, {"walks", "16"}};
  return rendered(sceneOf(elements),
                  {.passes = passes, .layers = LayerMask::all(), .method = "ims", .settings = settings});
}

/// Layers of direct light against those of `path`, as a whole.
void expectNear(const std::string& elements, int passes, double tolerance) {
  const RenderSession own = frame(elements, passes);
  const RenderSession truth = rendered(
      sceneOf(elements), {.passes = 256, .seed = 5, .layers = LayerMask::all(), .settings = {{"max_depth", "2"}}});
  for (const Layer layer : kDirect) {
    const double found = pixelMoments(own.film().layer(layer)).mean();
    const stats::Moments expected = replicateMoments(truth.film(), layer);
    if (!(expected.mean() > 0)) continue;
    const double noise = 4 * expected.standardError();
    fmt::print("{}: {:.4f} of the truth\n", kLayerNames[static_cast<size_t>(layer)], found / expected.mean());
    EXPECT_NEAR(found, expected.mean(), tolerance * expected.mean() + noise) << kLayerNames[static_cast<size_t>(layer)];
    EXPECT_LT(noise, 0.05 * expected.mean()) << "too few samples to tell";
  }
}

TEST(ImsFrameLamps, OneFrameOfEightIsTheSumOfEight) {
  constexpr int kLamps = 8;
  const RenderSession all = frame(fogBox(pointLamps(kLamps)));
  for (const Layer layer : kDirect) {
    Image rest = all.film().layer(layer);
    const double level = pixelMoments(rest).mean();
    double least = level;
    for (int k = 0; k < kLamps; ++k) {
      const Image one = frame(fogBox(pointLamp(k, kLamps))).film().layer(layer);
      least = std::min(least, pixelMoments(one).mean());
      for (size_t i = 0; i < rest.pixels.size(); ++i) rest.pixels[i] += one.pixels[i] * -1.f;
    }
    for (const Rgb& pixel : rest.pixels) ASSERT_NEAR(mean(pixel), 0, 1e-4 * level);
    EXPECT_GT(least, 0.01 * level) << "the test cannot tell whether a lamp is left out";
  }
}

TEST(ImsFrameLamps, OneFrameOfEightIsTheTruth) { expectNear(fogBox(pointLamps(8)), 1, 0.02); }

TEST(ImsFrameLamps, OneFrameOfTwoWithExtentIsNearTheTruth) {
  expectNear(fogBox(R"(
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="90"/>
      <translate x="-1" y="1.6"/></transform><emitter type="area"><rgb name="radiance" value="6, 5, 4"/></emitter></shape>
    <shape type="sphere"><float name="radius" value="0.25"/><point name="center" x="1.7" y="1.2" z="0.7"/>
      <emitter type="area"><rgb name="radiance" value="3, 6, 9"/></emitter></shape>)"),
             1, 0.05);
}

/// A ball of triangles that stand in the file in no order.
void writeBall(const std::filesystem::path& file) {
  constexpr int kAround = 12, kDown = 8, kCount = kAround * kDown;
  std::string text;
  for (int j = 0; j <= kDown; ++j)
    for (int i = 0; i < kAround; ++i) {
      const double polar = std::numbers::pi * j / kDown, azimuth = 2 * std::numbers::pi * i / kAround;
      text += fmt::format("v {} {} {}\n", std::sin(polar) * std::cos(azimuth), std::cos(polar),
                          std::sin(polar) * std::sin(azimuth));
    }
  for (int n = 0; n < kCount; ++n) {
    const int cell = n * 35 % kCount, i = cell % kAround, j = cell / kAround, next = (i + 1) % kAround;
    const int a = j * kAround + i + 1, b = j * kAround + next + 1, c = a + kAround, d = b + kAround;
    if (j > 0) text += fmt::format("f {} {} {}\n", a, b, c);
    if (j < kDown - 1) text += fmt::format("f {} {} {}\n", b, d, c);
  }
  std::ofstream(file) << text;
}

// Placed by the numbers of its triangles its four points gave 0.18 and 0.08 of the truth.
TEST(ImsFrameLamps, OneFrameOfAMeshIsNearTheTruth) {
  const ScratchFolder folder;
  writeBall(folder / "ball.obj");
  expectNear(fogBox(fmt::format(R"(<shape type="obj"><string name="filename" value="{}"/>
    <transform name="to_world"><scale value="0.3"/><translate x="1.2" y="1.4" z="0.5"/></transform>
    <emitter type="area"><rgb name="radiance" value="3, 6, 9"/></emitter></shape>)",
                                (folder / "ball.obj").string())),
             1, 0.12);
}

// Too many for a point each: they are drawn, and passes find them all.
TEST(ImsFrameLamps, PassesFindHowManyLampsThereAre) { expectNear(fogBox(pointLamps(100)), 64, 0.02); }

// Places at equal angles as seen from the lamp find a tenth of this light and less.
TEST(ImsFrameLamps, DenseFogIsLitWhereItIsSeen) {
  const std::string outside = R"(<emitter type="point"><point name="position" x="2" y="3" z="2"/>
                                 <rgb name="intensity" value="40"/></emitter>)";
  const std::string area = R"(<shape type="rectangle"><transform name="to_world"><scale value="0.5"/>
      <lookat origin="2, 3, 2" target="0, 0, 0" up="0, 1, 0"/></transform>
      <emitter type="area"><rgb name="radiance" value="40"/></emitter></shape>)";
  expectNear(fogBall(outside, 4), 1, 0.03);
  expectNear(fogBall(outside, 40), 1, 0.05);
  expectNear(fogBall(area, 40), 1, 0.05);
}

// Of four points on a lamp all may lie where it is dark.
TEST(ImsFrameLamps, TexturedLampSendsItsLightInTheFirstFrame) {
  expectNear(fogBox(R"(<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/>
      <translate y="1.9"/></transform><emitter type="area"><texture type="checkerboard" name="radiance">
        <rgb name="color0" value="0"/><rgb name="color1" value="20"/><transform name="to_uv"><scale value="4"/></transform>
      </texture></emitter></shape>)"),
             1, 0.05);
}

TEST(ImsFrameLamps, SkyLightsFloorsInTheFirstFrame) {
  expectNear(fogBox(R"(<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>)"), 1, 0.06);
}

// Passes together have points that are even on the lamp: no part of it, and no side, counts more than others.
TEST(LampPlaces, AreEvenOverThePasses) {
  const ScratchFolder folder;
  writeBall(folder / "ball.obj");
  const SceneSnapshot scene =
      sceneOf(fmt::format(R"(<sensor type="perspective"/><shape type="obj"><string name="filename" value="{}"/>
    <emitter type="area"/></shape>)",
                          (folder / "ball.obj").string()));
  const SceneView& view = scene->view;
  for (const int count : {2, 4}) {
    std::map<float, int> heights;
    Vec3 sum;
    const int passes = 512 / count;
    for (int pass = 0; pass < passes; ++pass) {
      const LampPlaces own(view, view.emitters[0], count, static_cast<uint32_t>(pass));
      ASSERT_EQ(own.places().size(), static_cast<size_t>(count));
      EXPECT_TRUE(own.facesApart());
      Vec3 set;
      for (const Vec2 u : own.places()) {
        const Vec3 normal = sampleLightPoint(view, view.emitters[0], u).normal;
        set += normal / static_cast<float>(count);
        ++heights[std::floor(u.x * 8)];
      }
      sum += set / static_cast<float>(passes);
      if (pass == 0 && count == 4) {
        EXPECT_LT(length(set), 0.15f) << "the first frame's points are on no side";
      }
    }
    EXPECT_LT(length(sum), 0.05f) << count;
    for (const auto& [part, n] : heights) EXPECT_NEAR(n, 64, 10) << count << " of part " << part;
  }
}

TEST(ImsFrameLamps, ManyAreAFunctionOfTheirInputForAnyNumberOfThreads) {
  const auto picture = [](size_t threads) {
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return frame(fogBox(pointLamps(12))).film().beauty();
  };
  const Image one = picture(1);
  EXPECT_EQ(largestDifference(one, picture(4)), 0);
  EXPECT_EQ(largestDifference(one, picture(1)), 0);
}

}  // namespace
}  // namespace virga
