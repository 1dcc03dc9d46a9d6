// SPDX-License-Identifier: Apache-2.0
#include "core/warp.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "stats/stats.h"

namespace virga {
namespace {

TEST(Warp, UniformSphere) {
  EXPECT_GT(stats::chiSquared({}, uniformSphere, [](Vec3) { return kInv4Pi; }), 1e-4);
  EXPECT_LT(stats::chiSquared({}, uniformSphere, [](Vec3 v) { return kInv4Pi * (1 + 0.03f * v.y); }), 1e-4)
      << "cannot fail";
}

TEST(Warp, UniformDisk) {
  const auto toSquare = [](Vec2 u) {
    const Vec2 d = uniformDisk(u);
    return Vec2{0.5f + 0.5f * d.x, 0.5f + 0.5f * d.y};
  };
  const auto radius = [](Vec2 p) { return 2 * std::hypot(p.x - 0.5f, p.y - 0.5f); };
  const auto uniform = [&](Vec2 p) { return radius(p) <= 1 ? 4 * kInvPi : 0; };
  EXPECT_GT(stats::chiSquaredSquare({}, toSquare, uniform), 1e-4);
  EXPECT_LT(
      stats::chiSquaredSquare({}, toSquare, [&](Vec2 p) { return uniform(p) * (0.9f + 0.2f * square(radius(p))); }),
      1e-4)
      << "cannot fail";
}

TEST(Warp, UniformDiskKeepsEdgesAndCentre) {
  EXPECT_EQ(uniformDisk({0.5f, 0.5f}), Vec2());
  for (Vec2 u : {Vec2{0, 0}, Vec2{1, 0}, Vec2{0, 1}, Vec2{1, 1}, Vec2{0, 0.3f}, Vec2{0.7f, 1}}) {
    const Vec2 d = uniformDisk(u);
    EXPECT_NEAR(std::hypot(d.x, d.y), 1, 1e-6);
  }
}

TEST(Warp, CosineHemisphere) {
  const auto cosine = [](Vec3 v) { return std::fmax(0.f, v.z) * kInvPi; };
  EXPECT_GT(stats::chiSquared({}, cosineHemisphere, cosine), 1e-4);
  EXPECT_LT(stats::chiSquared({}, cosineHemisphere, [&](Vec3 v) { return cosine(v) * (1 + 0.1f * (v.z - 2.f / 3)); }),
            1e-4)
      << "cannot fail";
}

TEST(Warp, UniformCone) {
  const auto sample = [](float height) { return [=](Vec2 u) { return uniformCone(u, height); }; };
  const auto density = [](float height) {
    return
        [=](Vec3 v) { return 0.5f * (v.x * v.x + v.y * v.y + square(v.z - 1)) <= height ? 1 / (kTwoPi * height) : 0; };
  };
  for (float height : {1e-4f, 0.1f, 1.f, 1.7f, 2.f}) {
    EXPECT_GT(stats::chiSquared({}, sample(height), density(height)), 1e-4) << height;
    EXPECT_LT(stats::chiSquared({}, sample(height), density(0.97f * height)), 1e-4) << "cannot fail at " << height;
  }
}

TEST(Warp, TinyConesKeepTheirShape) {
  // sin^2(theta) = v (2 - v) is uniform in [0, 2 height] here; a cosine in single precision would be 1.
  for (float height : {1e-6f, 1e-10f, 1e-20f}) {
    Pcg32 rng(1);
    std::vector<double> squares;
    for (int i = 0; i < 50'000; ++i) {
      const Vec3 v = uniformCone({rng.next(), rng.next()}, height);
      ASSERT_NEAR(length(v), 1, 1e-6);
      squares.push_back((static_cast<double>(v.x) * v.x + static_cast<double>(v.y) * v.y) /
                        (2 * static_cast<double>(height)));
    }
    EXPECT_GT(stats::kolmogorovSmirnov(squares, [](double x) { return std::fmin(x, 1.0); }), 1e-4) << height;
    EXPECT_LT(stats::kolmogorovSmirnov(squares, [](double x) { return std::fmin(1.02 * x, 1.0); }), 1e-4)
        << "cannot fail";
  }
  EXPECT_EQ(uniformCone({0.5f, 0.5f}, 0), Vec3(0, 0, 1));
}

TEST(Warp, UniformTriangle) {
  // In the unit square: twice the triangle's area is 1, the rest of the square stays empty.
  const auto density = [](Vec2 p) { return p.x + p.y <= 1 ? 2.f : 0.f; };
  EXPECT_GT(stats::chiSquaredSquare({}, uniformTriangle, density), 1e-4);
  EXPECT_LT(stats::chiSquaredSquare({}, uniformTriangle, [&](Vec2 p) { return density(p) * (0.95f + 0.15f * p.x); }),
            1e-4)
      << "cannot fail";
}

TEST(Warp, EndsOfTheRandomRangeStayFiniteAndUnit) {
  for (float x : {0.f, 0x1p-24f, 0x1.fffffep-1f})
    for (float y : {0.f, 0.5f, 0x1.fffffep-1f})
      for (Vec3 v :
           {uniformSphere({x, y}), cosineHemisphere({x, y}), uniformCone({x, y}, 0.2f), uniformCone({x, y}, 2)})
        EXPECT_NEAR(length(v), 1, 1e-6) << x << " " << y;
}

}  // namespace
}  // namespace virga
