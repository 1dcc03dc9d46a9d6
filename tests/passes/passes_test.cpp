// SPDX-License-Identifier: Apache-2.0
// A few passes of every way to render, on tiny pictures: short enough for builds with sanitizers, which see what the
// tests of methods compute. Whether it is right is told there.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "methods/ims_scenes.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr int kSize = 16;

struct Way {
  std::string method;
  SettingValues settings;
};

std::string nameOf(const Way& way) {
  std::string name = way.method;
  for (const auto& [key, value] : way.settings) name += " " + key + "=" + value;
  return name;
}

Film filmOf(const SceneSnapshot& scene, const Way& way, size_t threads) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  return rendered(scene, {.passes = 1, .layers = LayerMask::all(), .method = way.method, .settings = way.settings})
      .film();
}

void expectSoundPictures(const std::string& elements, const std::vector<Way>& ways) {
  const SceneSnapshot scene = sceneOf(elements);
  for (const Way& way : ways) {
    SCOPED_TRACE(nameOf(way));
    const Film film = filmOf(scene, way, 1);
    const Image picture = film.beauty();
    EXPECT_EQ(film.nonFiniteSamples(), 0u);
    for (const Rgb& pixel : picture.pixels) EXPECT_TRUE(std::isfinite(pixel.r + pixel.g + pixel.b));
    EXPECT_GT(pixelMoments(picture).mean(), 0.01);
    EXPECT_GT(pixelMoments(film.layer(Layer::directMedia)).mean(), 0);
    EXPECT_EQ(largestDifference(picture, filmOf(scene, way, 3).beauty()), 0);
  }
}

/// Fog without end around a ball between a floor and a lamp: `path` shares paths nowhere else.
std::string endlessFog() {
  return R"(<integrator type="volpath"/><medium type="homogeneous" id="fog"><float name="sigma_t" value="0.4"/>
      <float name="albedo" value="0.9"/></medium>
    <sensor type="perspective"><float name="fov" value="60"/>
      <transform name="to_world"><lookat origin="0, 0.3, 3" target="0, 0, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/></film>
      <ref name="medium" id="fog"/></sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/><translate y="-1"/></transform></shape>
    <shape type="sphere"><float name="radius" value="0.6"/><bsdf type="roughconductor"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/><translate y="2"/></transform>
      <emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>)";
}

TEST(Passes, EndlessFog) {
  expectSoundPictures(endlessFog(), {{"path", {}},
                                     {"ims", {{"mode", "fast"}, {"walks", "50"}}},
                                     {"ims", {{"mode", "frame"}, {"walks", "100"}, {"lights", "30"}}}});
  EXPECT_EQ(rendered(sceneOf(endlessFog()), {.passes = 1}).method().settingsInForce().at("shared_paths"), "true");
}

TEST(Passes, Plume) {
  expectSoundPictures(plume(kSize),
                      {{"path", {}},
                       {"ims", {{"walks", "100"}}},
                       {"ims", {{"walks", "100"}, {"compensation", "sampled"}, {"paths", "2"}, {"v1", "2"}}},
                       {"ims", {{"walks", "100"}, {"visibility", "shadow_map"}, {"compensation", "none"}}},
                       {"ims", {{"mode", "fast"}, {"walks", "50"}}},
                       {"ims", {{"mode", "frame"}, {"walks", "100"}, {"lights", "30"}}}});
}

}  // namespace
}  // namespace virga
