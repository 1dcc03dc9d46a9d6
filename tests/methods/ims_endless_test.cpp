// SPDX-License-Identifier: Apache-2.0
// Skies and suns around media without end that let their light through, at all or in one channel or beyond the values
// of a grid.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "methods/ims_checks.h"
#include "methods/ims_scenes.h"

namespace virga {
namespace {

using namespace virga::testing;

const std::string kSky = R"(<emitter type="constant"><rgb name="radiance" value="1, 0.8, 0.6"/></emitter>)";
const std::string kSun = R"(<emitter type="directional"><vector name="direction" x="0.3" y="-1" z="-0.5"/>
  <rgb name="irradiance" value="3, 3, 2"/></emitter>)";

/// A corner of a floor and a wall under a sky and a sun; the camera declares fog, unless `sigmaT` is empty.
std::string corner(const std::string& sigmaT) {
  const std::string fog = fmt::format(
      R"(<medium name="medium" type="homogeneous"><rgb name="sigma_t" value="{}"/><float name="albedo" value="0.9"/></medium>)",
      sigmaT);
  return kSky + kSun +
         fmt::format(R"(<sensor type="perspective"><float name="fov" value="40"/>{}
    <transform name="to_world"><lookat origin="0.3, 0.3, 4" target="0, -0.1, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="12"/><rfilter type="box"/></film></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.8"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><translate z="-1"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.7, 0.6"/></bsdf></shape>)",
                     sigmaT.empty() ? "" : fog);
}

struct Way {
  const char *name, *method;
  SettingValues settings;
};
const std::vector<Way> kWays = {{"path", "path", {}},
                                {"ims", "ims", {{"walks", "512"}}},
                                {"ims, kept", "ims", {{"walks", "512"}, {"retrace", "0.5"}}}};

constexpr Layer kThere[] = {Layer::emission, Layer::directSurface, Layer::surfaceToSurface};

TEST(ImsEndless, ClearFogIsNoFog) {
  const Estimates truth = estimates(sceneOf(corner("")), "path", {}, {.sets = 30, .passes = 4});
  for (const Way& way : kWays) {
    const Estimates found = estimates(sceneOf(corner("0, 0, 0")), way.method, way.settings, {.sets = 10, .seed = 2});
    expectSame(found, truth, way.name);
    expectPower(found, truth, {{Layer::emission, 0.02}, {Layer::directSurface, 0.02}, {Layer::surfaceToSurface, 0.06}},
                way.name);
  }
}

// Light of the others does not get to where anything is; that channel is as if there were no fog.
TEST(ImsEndless, AChannelWithoutExtinctionIsAsWithoutFog) {
  const Estimates truth = estimates(sceneOf(corner("")), "path", {}, {.sets = 30, .passes = 4});
  for (const Way& way : kWays) {
    const Estimates found =
        estimates(sceneOf(corner("0.5, 0.3, 0")), way.method, way.settings, {.sets = 10, .seed = 3});
    EXPECT_EQ(found.nonFinite, 0u) << way.name;
    for (const Layer layer : kThere) {
      const auto l = static_cast<size_t>(layer);
      for (int channel = 0; channel < 2; ++channel) EXPECT_EQ(found.at(l, 4, channel).mean(), 0) << kLayerNames[l];
      const stats::Moments &blue = found.at(l, 4, 2), &expected = truth.at(l, 4, 2);
      EXPECT_GT(stats::welchTest(blue, expected), kDisagree) << way.name << " " << kLayerNames[l];
      EXPECT_LT(blue.standardError(), 0.08 * expected.mean()) << way.name << " " << kLayerNames[l];
    }
  }
}

TEST(ImsEndless, AGridAroundEverythingUnderASkyAndASun) {
  const std::vector<Power> powers = {{Layer::directSurface, 0.02},    {Layer::directMedia, 0.04},
                                     {Layer::surfaceToSurface, 0.05}, {Layer::mediaToSurface, 0.06},
                                     {Layer::surfaceToMedia, 0.06},   {Layer::mediaToMedia, 0.06}};
  for (const std::string& light : {kSky, kSun}) {
    const SceneSnapshot scene = sceneOf(openPlume(12, light));
    const Estimates truth = estimates(scene, "path", {}, {.sets = 60, .passes = 4});
    for (const Way& way : kWays) {
      if (way.settings.empty()) continue;
      const Estimates found = estimates(scene, way.method, way.settings, {.sets = 50, .passes = 2, .seed = 4});
      expectSame(found, truth, way.name);
      expectPower(found, truth, powers, way.name);
    }
  }
}

}  // namespace
}  // namespace virga
