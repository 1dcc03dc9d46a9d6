// SPDX-License-Identifier: Apache-2.0
#include "transport/equiangular.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "stats/stats.h"

namespace virga {
namespace {

struct Case {
  const char* name;
  float t0, t1;
  float foot, height;  ///< of the light: along the ray from its origin, and beside it
  bool flat = false;   ///< nearly the same density everywhere, wherever the light stands
};
constexpr Case kCases[] = {{"beside the middle", 0, 10, 5, 1},
                           {"near the ray", 1, 10, 4, 0.01f},
                           {"ahead of the end", 0, 2, 5, 3},
                           {"behind the start", 0, 10, -4, 2},
                           {"far behind", 0, 10, -1000, 1, true},
                           {"very far behind", 0, 10, -1e4f, 1, true},
                           {"very far ahead", 0, 10, 1e5f, 3, true},
                           {"far beside", 3, 4, 0, 1e5f, true},
                           {"on the ray", 0, 10, 5, 0},
                           {"on the ray, behind", 0.01f, 5, -0.01f, 0},
                           {"at the start", 0, 3, 0, 0, true},
                           {"endless", 0, kInfinity, 5, 1},
                           {"endless, light behind", 2, kInfinity, -3, 1},
                           {"endless, light on the ray", 0, kInfinity, 2, 0},
                           {"a narrow part", 5, 5.001f, 5.2f, 0.1f, true},
                           {"from afar", 1000, 1001, 1000.5f, 0.2f}};

// The segment's ray points along an odd direction, so that nothing is exact by luck.
struct Scene {
  EquiangularSegment segment;
  Vec3 light;

  explicit Scene(const Case& c) {
    const Vec3 d = normalize(Vec3(0.36f, 0.48f, 0.8f));
    segment = {.medium = 0, .ray = {{1, 2, -3}, d}, .t0 = c.t0, .t1 = c.t1, .sigmaT = 0.5f};
    light = segment.ray.at(c.foot) + Frame(d).s * c.height;
  }
};

// Maps [t0, inf) to [0, 1): y = s / (1 + s) with s = (t - t0) / unit.
struct Compressed {
  double t0, unit;
  double coordinate(double t) const { return (t - t0) / (unit + t - t0); }
  double distance(double y) const { return t0 + unit * y / (1 - y); }
  double slope(double y) const { return unit / ((1 - y) * (1 - y)); }
};

double samplingP(const Case& c, const EquiangularSegment& claimed, Vec3 claimedLight) {
  const Scene scene(c);
  const double unit = std::isinf(c.t1) ? 5.0 : static_cast<double>(c.t1 - c.t0);
  const Compressed map{static_cast<double>(c.t0), unit};
  const double hi = std::isinf(c.t1) ? 1 - 1e-9 : 0.5;
  return stats::chiSquaredInterval(
      {.cells = 48, .lo = 0, .hi = hi, .samples = 100'000},
      [&](float u) -> std::optional<double> {
        return std::min(map.coordinate(static_cast<double>(scene.segment.sample(scene.light, u).t)), hi);
      },
      [&](double y) {
        return static_cast<double>(claimed.pdf(claimedLight, static_cast<float>(map.distance(y)))) * map.slope(y);
      });
}

TEST(EquiangularSegment, SamplesFollowTheDensity) {
  for (const Case& c : kCases) {
    const Scene scene(c);
    EXPECT_GT(samplingP(c, scene.segment, scene.light), 1e-4) << c.name;
  }
}

TEST(EquiangularSegment, AWrongLightIsNoticed) {
  for (const Case& c : kCases) {
    if (c.flat) continue;
    Scene scene(c);
    const float shift =
        c.height > 0.5f ? 0.4f * c.height + 0.5f : 0.2f * std::max(c.height, 0.5f * std::fabs(c.foot - c.t0));
    scene.light += scene.segment.ray.d * shift;
    EXPECT_LT(samplingP(c, scene.segment, scene.light), 1e-4) << c.name;
  }
}

TEST(EquiangularSegment, DensityIntegratesToOne) {
  for (const Case& c : kCases) {
    const Scene scene(c);
    // In the angle about the light the density is smooth, however near the ray it stands.
    const double height = std::max(static_cast<double>(c.height), 1e-4 * std::fabs(static_cast<double>(c.foot)));
    if (height == 0) continue;
    const double foot = static_cast<double>(c.foot);
    const double lo = std::atan((static_cast<double>(c.t0) - foot) / height);
    const double hi = std::isinf(c.t1) ? 1.570796 : std::atan((static_cast<double>(c.t1) - foot) / height);
    const double integral = stats::integrateInterval(
        [&](double angle) {
          const double t = foot + height * std::tan(angle), cosine = std::cos(angle);
          return static_cast<double>(scene.segment.pdf(scene.light, static_cast<float>(t))) * height /
                 (cosine * cosine);
        },
        lo, hi, 1e-6);
    EXPECT_NEAR(integral, 1, 3e-3) << c.name;
  }
}

TEST(EquiangularSegment, SampleReportsItsDensity) {
  for (const Case& c : kCases) {
    const Scene scene(c);
    Pcg32 random(3);
    for (int i = 0; i < 5000; ++i) {
      const float u = i == 0 ? 0 : (i == 1 ? 0x1.fffffep-1f : random.next());
      const EquiangularSegment::Sample s = scene.segment.sample(scene.light, u);
      ASSERT_TRUE(s.t >= c.t0 && s.t <= c.t1) << c.name << " " << s.t;
      ASSERT_TRUE(s.pdf > 0 && std::isfinite(s.pdf)) << c.name << " " << s.pdf << " at " << s.t;
      // A distance is known to some units in the last place, which is much of a small height.
      const float slack = 1e-3f + 4e-7f * (std::fabs(s.t) + std::fabs(c.foot)) /
                                      std::max({c.height, std::fabs(s.t - c.foot), 1e-4f * std::fabs(c.foot), 1e-16f});
      ASSERT_NEAR(s.pdf / scene.segment.pdf(scene.light, s.t), 1, slack) << c.name << " at " << s.t;
    }
  }
}

// What all of this is for: the light of a point in a homogeneous medium, without its transmittance toward the light.
TEST(EquiangularSegment, EstimatesTheIntegralOfTheInverseSquare) {
  for (const Case& c : kCases) {
    if (c.height == 0) continue;
    const Scene scene(c);
    const double height = static_cast<double>(c.height), foot = static_cast<double>(c.foot);
    const double x0 = static_cast<double>(c.t0) - foot, x1 = static_cast<double>(c.t1) - foot;
    // atan b - atan a without cancellation
    const double angle =
        std::isinf(x1) ? std::atan2(height, x0) : std::atan2(height * (x1 - x0), height * height + x0 * x1);
    stats::Moments m;
    Pcg32 random(5);
    for (int i = 0; i < 20'000; ++i) {
      const EquiangularSegment::Sample s = scene.segment.sample(scene.light, random.next());
      const double x = static_cast<double>(s.t) - foot;
      m.add(1 / (height * height + x * x) / static_cast<double>(s.pdf));
    }
    // The estimator has next to no variance; single precision of the height remains.
    EXPECT_NEAR(m.mean() / (angle / height), 1, 3e-3) << c.name;
  }
}

TEST(EquiangularSegment, FreeFlightIsExponential) {
  const EquiangularSegment s{.medium = 0, .ray = {{}, {0, 0, 1}}, .t0 = 2, .t1 = kInfinity, .sigmaT = 0.5f};
  EXPECT_FLOAT_EQ(s.flight(4).g, 0.5f * std::exp(-1.f));
  EXPECT_FLOAT_EQ(s.freeFlightPdf(4), 0.5f * std::exp(-1.f));
  EXPECT_TRUE(s.contains(2) && s.contains(1e30f));
  EXPECT_FALSE(s.contains(1.9f));
  EXPECT_FALSE(EquiangularSegment().contains(0));
}

}  // namespace
}  // namespace virga
