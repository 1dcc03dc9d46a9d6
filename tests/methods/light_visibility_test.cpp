// SPDX-License-Identifier: Apache-2.0
// What virtual lights know of the surfaces around them, and what pictures become of it.
#include "methods/instant_scattering/light_visibility.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/warp.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

/// Fog in a room with a block, a ball, a disk and a tube; a lamp under the ceiling.
SceneSnapshot foggyRoom() {
  return sceneOf(R"(<shape type="cube"><boolean name="flip_normals" value="true"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.2" y="0.5" z="0.2"/><rotate y="1" angle="30"/>
      <translate x="-0.4" y="-0.5"/></transform></shape>
    <shape type="sphere"><point name="center" x="0.4" y="-0.7" z="0.3"/><float name="radius" value="0.3"/>
      <bsdf type="phong"><float name="exponent" value="6"/></bsdf></shape>
    <shape type="disk"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="70"/>
      <translate x="0.4" y="0.3" z="-0.4"/></transform><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
    <shape type="cylinder"><float name="radius" value="0.1"/><point name="p0" x="-0.9" y="0.4" z="-0.5"/>
      <point name="p1" x="0" y="0.7" z="-0.6"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/>
      <translate y="0.97"/></transform><emitter type="area"><rgb name="radiance" value="8, 7, 6"/></emitter></shape>
    <shape type="cube"><transform name="to_world"><scale value="0.99"/></transform><bsdf type="null"/>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="0.8"/><float name="albedo" value="0.9"/>
      </medium></shape>
    <sensor type="perspective"><float name="fov" value="70"/><transform name="to_world">
      <lookat origin="0, 0, 0.9" target="0, -0.2, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
    <integrator type="volpath"><integer name="max_depth" value="6"/></integrator>)");
}

TEST(MinimumDepth, NothingThatCouldBlockIsNearer) {
  const SceneSnapshot scene = foggyRoom();
  const VirtualLights all = traceVirtualLights(*scene, {.walks = 400, .maxDepth = 4}, {5, 1, 0, 3});
  const std::vector<float> depths = minimumDepths(*scene->surfaceRays, all.lights);
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  Pcg32 random(1);
  int useful = 0, onSurfaces = 0, tight = 0;
  for (size_t i = 0; i < all.lights.size(); ++i) {
    const LightVertex& v = all.lights[i];
    useful += depths[i] > 0.05f;
    onSurfaces += v.kind == VertexKind::surface && depths[i] > 0.05f;
    float nearest = kInfinity;
    for (int k = 0; k < 200; ++k) {
      Vec3 w = uniformSphere({random.next(), random.next()});
      if (v.kind == VertexKind::surface && v.surface < 0 && dot(w, v.normal) < 0) w = -w;
      const Vec3 side = v.normal * (dot(w, v.normal) < 0 ? -1.f : 1.f);
      nearest = std::min(nearest, rays.nearest({v.p + side * 1e-5f, w}, kInfinity).t);
    }
    EXPECT_LE(depths[i], nearest + 2e-5f);
    tight += depths[i] > 0.8f * nearest;
  }
  const auto count = static_cast<int>(all.lights.size());
  EXPECT_GT(useful, count / 2);
  EXPECT_GT(onSurfaces, count / 8) << "a wall does not stand in its own way";
  EXPECT_GT(tight, count / 2);
}
TEST(MinimumDepth, OfTriangles) {
  const SceneSnapshot scene =
      sceneOf(R"(<shape type="rectangle"/>)" + pinpointSensor("0, 0, 4", "0, 0, 0", "0, 1, 0", 4));
  const RayScene& surfaces = *scene->surfaceRays;
  EXPECT_FLOAT_EQ(surfaces.clearance({0.2f, 0.1f, 3}, {}), 3);
  EXPECT_FLOAT_EQ(surfaces.clearance({4, 0.5f, 0}, {}), 3);
  EXPECT_FLOAT_EQ(surfaces.clearance({4, 5, 0}, {}), 5);
  EXPECT_FLOAT_EQ(surfaces.clearance({4, 5, 12}, {}), 13);
  EXPECT_NEAR(surfaces.clearance({0.3f, -0.3f, 0}, {}), 0, 1e-6f);
  const Vec3 up(0, 0, 1), down(0, 0, -1), both[] = {up, down}, aside(1, 0, 0);
  EXPECT_EQ(surfaces.clearance({0.3f, -0.3f, 0}, both), kInfinity);
  EXPECT_EQ(surfaces.clearance({0.3f, -0.3f, 1}, std::span(&up, 1)), kInfinity);
  EXPECT_FLOAT_EQ(surfaces.clearance({0.3f, -0.3f, 1}, both), 1);
  EXPECT_NEAR(surfaces.clearance({0.3f, -0.3f, 0}, std::span(&aside, 1)), 0, 1e-6f);
}
TEST(MinimumDepth, WhereThereIsNothing) {
  const SceneSnapshot scene = sceneOf(pinpointSensor("0, 0, 4", "0, 0, 0", "0, 1, 0", 4));
  EXPECT_EQ(scene->surfaceRays->clearance({1, 2, 3}, {}), kInfinity);
  const LightVertex light;
  EXPECT_EQ(minimumDepths(*scene->surfaceRays, std::span(&light, 1)).front(), kInfinity);
}

Image pictureOf(const SceneSnapshot& scene, const std::string& visibility, const std::string& compensation,
                int passes = 8) {
  SettingValues settings = {
      {"visibility", visibility}, {"compensation", compensation}, {"radius", "0.5"}, {"walks", "40"}};
  if (visibility == "shadow_map") settings.insert({{"map_resolution", "64"}, {"map_points", "2000"}});
  return rendered(scene, {.passes = passes, .method = "ims", .settings = settings}).film().beauty();
}

// Only rays are left out that would have met nothing: each sample is the same.
TEST(LightVisibility, MinimumDepthsChangeNothing) {
  const SceneSnapshot scene = foggyRoom();
  for (const char* compensation : {"path", "sampled"}) {
    const Image exact = pictureOf(scene, "exact", compensation);
    EXPECT_EQ(largestDifference(exact, pictureOf(scene, "minimum_depth", compensation)), 0) << compensation;
    EXPECT_GT(largestDifference(exact, pictureOf(scene, "none", compensation)), 0) << "the test cannot fail";
  }
}

double meanOf(const Image& image) { return pixelMoments(image).mean(); }

TEST(LightVisibility, ShadowMapsAreNearTheTruthAndNothingIsNot) {
  const SceneSnapshot scene = foggyRoom();
  for (const char* compensation : {"path", "sampled"}) {
    const double exact = meanOf(pictureOf(scene, "exact", compensation, 16));
    EXPECT_NEAR(meanOf(pictureOf(scene, "shadow_map", compensation, 16)) / exact, 1, 0.05) << compensation;
    EXPECT_GT(meanOf(pictureOf(scene, "none", compensation, 16)) / exact, 1.01) << compensation;
  }
}

TEST(LightVisibility, WhatIsBiasedSaysSo) {
  const SceneSnapshot scene = foggyRoom();
  const auto biased = [&](const char* visibility) {
    RenderSession session(scene, findMethod("ims"),
                          {.settings = {.values = {{"visibility", visibility}, {"walks", "20"}}, .seed = 1}});
    return session.step().biased;
  };
  EXPECT_FALSE(biased("exact"));
  EXPECT_FALSE(biased("minimum_depth"));
  EXPECT_TRUE(biased("shadow_map"));
  EXPECT_TRUE(biased("none"));
}

void expectRefusal(SettingValues settings, const std::string& message) {
  settings["visibility"] = "shadow_map";
  try {
    rendered(foggyRoom(), {.passes = 1, .method = "ims", .settings = settings});
    FAIL() << "it should have been refused: " << message;
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find(message), std::string::npos) << e.what();
  }
}
TEST(LightVisibility, WhatTakesTooMuchMemoryIsRefused) {
  expectRefusal({{"walks", "20000"}, {"map_resolution", "256"}}, "would take");
  expectRefusal({{"map_resolution", "5000"}}, "map_resolution may be at most 1024");
  expectRefusal({{"map_points", "1000000000"}}, "map_points may be at most");
}
TEST(LightVisibility, WithoutLightsOrSurfacesThereIsNothingToSee) {
  const std::string camera = pinpointSensor("0, 0, 4", "0, 0, 0", "0, 1, 0", 4);
  const std::string fog =
      R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"/></shape>)";
  for (const char* visibility : {"minimum_depth", "shadow_map", "none"})
    for (const std::string& scene : {camera, fog + camera, R"(<shape type="cube"/>)" + camera}) {
      const virga::testing::Run run{
          .passes = 1, .method = "ims", .settings = {{"visibility", visibility}, {"walks", "20"}}};
      EXPECT_EQ(meanOf(rendered(sceneOf(scene), run).film().beauty()), 0) << visibility;
      const Image lit = rendered(sceneOf(scene + R"(<emitter type="point"><point name="position" x="0" y="0" z="3"/>
        </emitter>)"),
                                 run)
                            .film()
                            .beauty();
      EXPECT_TRUE(std::isfinite(meanOf(lit))) << visibility;
    }
}

}  // namespace
}  // namespace virga
