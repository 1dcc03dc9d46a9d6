// SPDX-License-Identifier: Apache-2.0
// Packets of rays find what single rays do.
#include <gtest/gtest.h>

#include "core/random.h"
#include "rays/ray_scene.h"
#include "scene/scenes.h"

namespace virga {
namespace {

SceneSnapshot shapes() {
  return test::build(R"(
    <shape type="sphere"><float name="radius" value="0.5"/><point name="center" x="0.7" y="0" z="0"/></shape>
    <shape type="disk"><transform name="to_world"><translate z="-0.5"/></transform></shape>
    <shape type="cylinder"><float name="radius" value="0.2"/><point name="p0" x="-1" y="-1" z="0"/>
      <point name="p1" x="-1" y="1" z="0"/></shape>
    <shape type="cube"><transform name="to_world"><scale value="0.3"/><rotate x="1" y="1" angle="40"/></transform></shape>)");
}

/// Rays into the scene from all around; some end early, and some take no part.
struct Rays {
  Ray ray[RayPacket::kSize];
  RayPacket packet;

  explicit Rays(Pcg32& random) {
    const auto within = [&](float half) {
      return Vec3(random.next() - 0.5f, random.next() - 0.5f, random.next() - 0.5f) * (2 * half);
    };
    for (int i = 0; i < RayPacket::kSize; ++i) {
      const Vec3 o = within(3);
      ray[i] = {o, normalize(within(1) - o)};
      const float choice = random.next();
      packet.set(i, ray[i], choice < 0.2f ? 0 : choice < 0.4f ? 2 : kInfinity);
    }
  }
};

void expectTheSame(const RayScene& scene) {
  Pcg32 random(1);
  int met = 0;
  for (int n = 0; n < 500; ++n) {
    const Rays rays(random);
    const PacketHits hits = scene.nearest(rays.packet);
    const uint32_t occluded = scene.occluded(rays.packet);
    for (int i = 0; i < RayPacket::kSize; ++i) {
      const float end = rays.packet.tMax[i];
      const RayHit expected = end > 0 ? scene.nearest(rays.ray[i], 0, end) : RayHit{};
      const RayHit& found = hits[static_cast<size_t>(i)];
      // Embree's packets round otherwise: a ray along an edge may do either.
      ASSERT_EQ(found.shape, expected.shape) << n << " " << i;
      if (expected.found()) {
        ASSERT_NEAR(found.t, expected.t, 1e-5f * expected.t);
        ASSERT_EQ(found.primitive, expected.primitive);
      }
      ASSERT_EQ((occluded >> i & 1u) != 0, expected.found());
      met += expected.found();
    }
  }
  EXPECT_GT(met, 500) << "the test cannot tell";
}

TEST(RayPackets, FindWhatSingleRaysDo) { expectTheSame(*shapes()->surfaceRays); }

TEST(RayPackets, KnowShapesThatMoved) {
  const SceneSnapshot scene = shapes();
  RayScene::Shapes moved = scene->surfaceRays->shapes();
  moved[0] = RayShape::sphere({0.5f, 0.6f, 0}, 0.4f);
  const RayScene next(moved, scene->surfaceRays.get());
  ASSERT_EQ(next.movedShapes(), 1);
  expectTheSame(next);
}

TEST(RayPackets, MeetNothingInAnEmptyScene) {
  const RayScene empty({});
  Pcg32 random(1);
  const Rays rays(random);
  EXPECT_EQ(empty.occluded(rays.packet), 0u);
  for (const RayHit& hit : empty.nearest(rays.packet)) EXPECT_FALSE(hit.found());
  EXPECT_TRUE(empty.bounds().empty());
}

TEST(RayPackets, BoundsHoldAllShapes) {
  const Bounds b = shapes()->surfaceRays->bounds();
  EXPECT_NEAR(b.lo.x, -1.2f, 1e-4f);
  EXPECT_NEAR(b.hi.x, 1.2f, 1e-4f);
}

}  // namespace
}  // namespace virga
