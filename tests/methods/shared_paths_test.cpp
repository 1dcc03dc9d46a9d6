// SPDX-License-Identifier: Apache-2.0
// Pixels that share paths in fog against pixels each on its own, layer by layer.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "methods/layer_means.h"
#include "methods/path/pixel_groups.h"

namespace virga {
namespace {

using namespace virga::testing;

struct Fog {
  double sigmaT = 0.6;
  const char* phase = R"(<phase type="isotropic"/>)";
  const char* limits = "";  ///< of paths
  const char* glow = "";
  const char* lamp = "";  ///< besides the one on the ceiling
};

constexpr const char* kRectangle = R"(<shape type="rectangle"><transform name="to_world">{}</transform>{}</shape>)";

std::string wall(const char* transform, const char* colour) {
  return fmt::format(fmt::runtime(kRectangle), transform,
                     fmt::format(R"(<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>)", colour));
}

/// A room in fog with a lamp near its ceiling, half behind a screen; in it a round white column (whose normals are not
/// those of its triangles everywhere), a mirror, a ball of rough metal and a glass ball.
std::string room(const Fog& fog = {}) {
  return fmt::format(
             R"(<integrator type="volpath">{}</integrator>
  <medium type="homogeneous" id="fog"><float name="sigma_t" value="{}"/><rgb name="albedo" value="0.95, 0.9, 0.8"/>{}{}</medium>{}
  <sensor type="perspective"><float name="fov" value="80"/>
    <transform name="to_world"><lookat origin="0, 0, 0.95" target="0, -0.1, -1" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="19"/><integer name="height" value="19"/><rfilter type="box"/></film>
    <ref name="medium" id="fog"/></sensor>
  <shape type="sphere"><point name="center" x="0.5" y="-0.7" z="-0.3"/><float name="radius" value="0.3"/>
    <bsdf type="roughconductor"><float name="alpha" value="0.4"/><rgb name="specular_reflectance" value="0.9, 0.8, 0.6"/></bsdf></shape>
  <shape type="sphere"><point name="center" x="-0.6" y="-0.7" z="0.1"/><float name="radius" value="0.25"/><bsdf type="dielectric"/></shape>
  <shape type="cylinder"><point name="p0" x="-0.5" y="-1" z="-0.5"/><point name="p1" x="-0.5" y="0.5" z="-0.5"/>
    <float name="radius" value="0.2"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.2"/><rotate x="1" angle="90"/>
    <translate x="0.3" y="0.9"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="25, 22, 18"/></emitter></shape>)",
             fog.limits, fog.sigmaT, fog.phase, fog.glow, fog.lamp) +
         wall(R"(<rotate x="1" angle="-90"/><translate y="-1"/>)", "0.7, 0.7, 0.7") +
         wall(R"(<rotate x="1" angle="90"/><translate y="1"/>)", "0.7, 0.7, 0.7") +
         wall(R"(<translate z="-1"/>)", "0.6, 0.7, 0.6") +
         wall(R"(<rotate y="1" angle="90"/><translate x="-1"/>)", "0.7, 0.05, 0") +
         wall(R"(<scale x="0.3" y="0.2"/><translate x="0.1" y="0.75"/>)", "0.5, 0.5, 0.5") +
         fmt::format(fmt::runtime(kRectangle), R"(<rotate y="1" angle="-90"/><translate x="1"/>)",
                     R"(<bsdf type="conductor"/>)");
}

LayerMeans pictures(const SceneSnapshot& scene, bool shared, uint64_t seed, int passes) {
  return layerMeans(scene, {.passes = passes, .seed = seed, .settings = {{"shared_paths", shared ? "true" : "false"}}});
}

void expectSameLayers(const Fog& fog) {
  constexpr int passes = 96;
  const LayerMeans alone = pictures(sceneOf(room(fog)), false, 1, 2 * passes);
  expectSameLayers(alone, pictures(sceneOf(room(fog)), true, 11, passes), "shared");
  // What the test can tell.
  Fog denserFog = fog;
  denserFog.sigmaT *= 1.25;
  const LayerMeans denser = pictures(sceneOf(room(denserFog)), true, 11, passes);
  EXPECT_LT(std::min(agreement(alone, denser, Layer::mediaToMedia), agreement(alone, denser, Layer::surfaceToMedia)),
            1e-3);
}

TEST(SharedPaths, EveryLayerInFog) { expectSameLayers({}); }

TEST(SharedPaths, EveryLayerInFogThatScattersForward) {
  expectSameLayers({1.5, R"(<phase type="hg"><float name="g" value="0.5"/></phase>)"});
}

// Four segments are the fewest at which there is something to share.
TEST(SharedPaths, EveryLayerOfShortPathsWithTwoLampsInFogThatGlows) {
  Fog fog;
  fog.limits = R"(<integer name="max_depth" value="4"/><integer name="rr_depth" value="2"/>)";
  fog.glow = R"(<rgb name="emission" value="0.01, 0.02, 0.03"/>)";
  fog.lamp =
      R"(<emitter type="point"><point name="position" x="-0.2" y="0.1" z="0.3"/><rgb name="intensity" value="0.3"/></emitter>)";
  expectSameLayers(fog);
}

TEST(SharedPaths, LeaveLessNoise) {
  const auto error = [](const char* shared) {
    return rendered(sceneOf(room()), {.passes = 64, .settings = {{"shared_paths", shared}}}).film().estimatedRelMse();
  };
  // Half of the light comes by way of mirror and glass, where nothing is shared.
  EXPECT_LT(error("true").value(), 0.85 * error("false").value());
}

TEST(SharedPaths, AreForFogThatFillsAllSpace) {
  const auto inForce = [](const std::string& elements) {
    return rendered(sceneOf(elements), {.passes = 1}).method().settingsInForce().at("shared_paths");
  };
  EXPECT_EQ(inForce(room()), "true");
  EXPECT_EQ(
      inForce(room() + R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"/></shape>)"),
      "false");
}

TEST(PixelGroups, HaveEachPixelOnce) {
  for (const auto& [width, height] : {std::pair{1, 1}, {17, 5}, {40, 33}, {3, 64}})
    for (uint64_t key = 0; key < 20; ++key) {
      const PixelGroups groups(width, height, key);
      std::set<std::pair<int, int>> seen;
      std::array<PixelAt, PixelGroups::kMostPixels> storage;
      for (int64_t tile = 0; tile < int64_t{groups.tilesX()} * groups.tilesY(); ++tile)
        for (int g = 0; g < PixelGroups::kGroups; ++g)
          for (const PixelAt& at : groups.group(tile, g, storage)) {
            EXPECT_TRUE(at.x >= 0 && at.x < width && at.y >= 0 && at.y < height);
            EXPECT_TRUE(seen.insert({at.x, at.y}).second);
          }
      EXPECT_EQ(seen.size(), static_cast<size_t>(width * height));
    }
}

}  // namespace
}  // namespace virga
