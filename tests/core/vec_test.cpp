// SPDX-License-Identifier: Apache-2.0
#include "core/vec.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/rgb.h"
#include "core/warp.h"

namespace virga {
namespace {

void expectOrthonormal(Vec3 z) {
  const Frame f(z);
  ASSERT_EQ(f.n, z);
  ASSERT_NEAR(length(f.s), 1, 1e-6) << z.x << " " << z.y << " " << z.z;
  ASSERT_NEAR(length(f.t), 1, 1e-6) << z.x << " " << z.y << " " << z.z;
  ASSERT_NEAR(dot(f.s, f.t), 0, 1e-6) << z.x << " " << z.y << " " << z.z;
  ASSERT_NEAR(dot(f.s, z), 0, 1e-6) << z.x << " " << z.y << " " << z.z;
  ASSERT_NEAR(dot(f.t, z), 0, 1e-6) << z.x << " " << z.y << " " << z.z;
  ASSERT_NEAR(distance(cross(f.s, f.t), z), 0, 2e-6) << "right-handed";
}

TEST(Frame, IsOrthonormalEverywhere) {
  Pcg32 rng(1);
  for (int i = 0; i < 10'000; ++i) expectOrthonormal(normalize(uniformSphere({rng.next(), rng.next()})));
}

TEST(Frame, IsOrthonormalNearThePolesAndTheEquator) {
  for (float side : {1.f, -1.f}) {
    expectOrthonormal({0, 0, side});
    for (float e : {1e-1f, 1e-3f, 3.5e-4f, 1e-5f, 1e-8f, 1e-20f, 1e-40f}) {
      expectOrthonormal(normalize(Vec3(e, -0.5f * e, side)));
      expectOrthonormal(normalize(Vec3(0.6f, -0.8f, side * e)));
    }
  }
  expectOrthonormal({1, 0, 0.f});
  expectOrthonormal({0, 1, -0.f});
}

TEST(Frame, LocalAndWorldAreInverse) {
  const Frame f(normalize(Vec3(0.3f, 0.1f, -0.9f)));
  const Vec3 v(0.5f, -2, 0.25f);
  EXPECT_NEAR(distance(f.toLocal(f.toWorld(v)), v), 0, 1e-6);
  EXPECT_EQ(f.toWorld({0, 0, 1}), f.n);
}

TEST(Vec3, CrossFollowsTheRightHand) {
  EXPECT_EQ(cross({1, 0, 0}, {0, 1, 0}), Vec3(0, 0, 1));
  EXPECT_EQ(cross({0, 1, 0}, {0, 0, 1}), Vec3(1, 0, 0));
}

TEST(Vec3, FiniteMeansEveryComponent) {
  EXPECT_TRUE(isFinite(Vec3(1, -2, 0)));
  for (float bad : {kInfinity, -kInfinity, std::nanf("")})
    for (int i = 0; i < 3; ++i) {
      Vec3 v(1);
      v[i] = bad;
      EXPECT_FALSE(isFinite(v));
      EXPECT_FALSE(isFinite(Rgb(v.x, v.y, v.z)));
    }
}

TEST(Bounds, GrowFromNothing) {
  Bounds b;
  EXPECT_TRUE(b.empty());
  b.extend(Vec3(1, 2, 3));
  EXPECT_FALSE(b.empty());
  EXPECT_EQ(b.extent(), Vec3(0.f));
  Bounds other;
  other.extend(Vec3(-1, 4, 3));
  b.extend(other);
  EXPECT_EQ(b.center(), Vec3(0, 3, 3));
  EXPECT_EQ(b.corner(0), b.lo);
  EXPECT_EQ(b.corner(7), b.hi);
  EXPECT_EQ(b.corner(2), Vec3(-1, 4, 3));
  b.extend(Bounds());
  EXPECT_EQ(b.extent(), Vec3(2, 2, 0));
}

}  // namespace
}  // namespace virga
