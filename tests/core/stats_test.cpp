// SPDX-License-Identifier: Apache-2.0
#include "stats/stats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "core/warp.h"

namespace virga {
namespace {

TEST(Stats, DistributionFunctionsHaveTheirClosedForms) {
  for (double x : {0.01, 0.5, 1.0, 3.0, 20.0, 400.0}) {
    EXPECT_NEAR(stats::gammaUpper(1, x), std::exp(-x), 1e-13) << x;
    EXPECT_NEAR(stats::gammaUpper(0.5, x), std::erfc(std::sqrt(x)), 1e-13) << x;
    EXPECT_NEAR(stats::gammaUpper(3, x), std::exp(-x) * (1 + x + x * x / 2), 1e-12) << x;
  }
  for (double t : {-20.0, -1.0, 0.0, 0.3, 2.0, 50.0}) {
    EXPECT_NEAR(stats::studentCdf(t, 1), 0.5 + std::atan(t) / 3.141592653589793, 1e-12) << t;
    EXPECT_NEAR(stats::studentCdf(t, 2), 0.5 + t / (2 * std::sqrt(2 + t * t)), 1e-12) << t;
    EXPECT_NEAR(stats::studentCdf(t, 1e7), stats::normalCdf(t), 1e-7) << t;
  }
  EXPECT_NEAR(stats::normalCdf(1.959963984540054), 0.975, 1e-12);
  EXPECT_NEAR(stats::betaRegularised(3, 1, 0.7), 0.343, 1e-13);
  EXPECT_NEAR(stats::betaRegularised(1, 4, 0.2), 1 - std::pow(0.8, 4), 1e-13);
  // Critical values of the tables.
  EXPECT_NEAR(stats::chiSquaredTail(18.307038, 10), 0.05, 1e-7);
  EXPECT_NEAR(stats::chiSquaredTail(593.2, 511), 0.0069, 2e-4);
  EXPECT_NEAR(stats::kolmogorovTail(1.3580986), 0.05, 1e-7);
}

TEST(Stats, PValuesAreHonestWhereTheClaimIsTrue) {
  std::vector<double> sphere, interval, square, welch, one;
  for (uint64_t seed = 1; seed <= 100; ++seed) {
    Pcg32 rng(1000 + seed);
    sphere.push_back(stats::chiSquared({.theta = 6, .phi = 8, .axis = {1, 2, -2}, .samples = 4000, .seed = seed},
                                       uniformSphere, [](Vec3) { return kInv4Pi; }));
    interval.push_back(stats::chiSquaredInterval(
        {.cells = 20, .hi = 3, .samples = 4000, .seed = seed}, [](float u) { return -std::log1p(-u); },
        [](double x) { return std::exp(-x); }));
    square.push_back(stats::chiSquaredSquare(
        {.nx = 5, .ny = 5, .samples = 4000, .seed = seed},
        [](Vec2 u) {
          return Vec2{std::sqrt(u.x), u.y};
        },
        [](Vec2 p) { return 2 * p.x; }));
    stats::Moments a, b;
    for (int i = 0; i < 12; ++i) a.add(rng.next() + rng.next() + rng.next());
    for (int i = 0; i < 20; ++i) b.add(2 * (rng.next() + rng.next() + rng.next()) - 1.5f);
    welch.push_back(stats::welchTest(a, b));
    one.push_back(stats::oneSampleTest(a, 1.5));
  }
  const auto uniform = [](double x) { return x; };
  // The grids take the worst of four dependent statistics: too cautious, by less than a factor 4.
  for (const auto& p : {sphere, interval, square}) {
    const auto rejected = std::count_if(p.begin(), p.end(), [](double v) { return v < 0.2; });
    EXPECT_LE(rejected, 32);
    EXPECT_GE(rejected, 3);
  }
  EXPECT_GT(stats::kolmogorovSmirnov(welch, uniform), 1e-3);
  EXPECT_GT(stats::kolmogorovSmirnov(one, uniform), 1e-3);
  EXPECT_LT(stats::kolmogorovSmirnov(one, [](double x) { return x * x; }), 1e-3);
}

TEST(Stats, WrongDensitiesAreRejected) {
  const auto sphere = [](auto density) { return stats::chiSquared({}, uniformSphere, density); };
  EXPECT_LT(sphere([](Vec3 v) { return kInv4Pi * (1 + 0.05f * v.z); }), 1e-4);
  EXPECT_LT(sphere([](Vec3 v) { return kInv4Pi * (1 + 0.05f * v.x); }), 1e-4);
  EXPECT_LT(sphere([](Vec3) { return 1.05f * kInv4Pi; }), 1e-4) << "more than 1";
  EXPECT_LT(sphere([](Vec3) { return 0.95f * kInv4Pi; }), 1e-4) << "less than 1 with nothing lost";
  EXPECT_LT(sphere([](Vec3 v) { return v.z > 0 ? 2 * kInv4Pi : 0; }), 1e-4) << "samples without density";
  EXPECT_LT(sphere([](Vec3) { return std::nanf(""); }), 1e-4);
  EXPECT_LT(stats::chiSquaredInterval(
                {}, [](float u) { return u; }, [](double x) { return 0.97 + 0.06 * x; }),
            1e-4);
  EXPECT_LT(stats::chiSquaredSquare(
                {}, [](Vec2 u) { return u; }, [](Vec2 p) { return 0.95f + 0.1f * p.y; }),
            1e-4);
}

TEST(Stats, LostSamplesAreAccountedFor) {
  const auto upper = [](Vec2 u) -> std::optional<Vec3> {
    const Vec3 v = uniformSphere(u);
    return v.z > 0 ? std::optional(v) : std::nullopt;
  };
  EXPECT_GT(stats::chiSquared({}, upper, [](Vec3 v) { return v.z > 0 ? kInv4Pi : 0; }), 1e-4);
  EXPECT_LT(stats::chiSquared({}, upper, [](Vec3 v) { return v.z > 0 ? 1.02f * kInv4Pi : 0; }), 1e-4);
  EXPECT_LT(stats::chiSquared({}, upper, [](Vec3 v) { return v.z > 0 ? 2 * kInv4Pi : 0; }), 1e-4);
}

TEST(Stats, IntegralsOfPeaksAndJumps) {
  const Vec3 axis = normalize(Vec3(0.2f, -0.7f, 0.4f));
  EXPECT_NEAR(stats::integrateSphere([](Vec3) { return 1; }), 12.566370614, 1e-5);
  EXPECT_NEAR(stats::integrateSphere([&](Vec3 v) { return std::fmax(0.f, dot(axis, v)); }), 3.14159265, 3e-5);
  // Within 1 - cos(theta) < 1e-4 of the axis.
  EXPECT_NEAR(stats::integrateSphere([&](Vec3 v) { return length(axis - v) < std::sqrt(2e-4f) ? 1e4 : 0; }, axis),
              6.2831853, 1e-2);
  EXPECT_NEAR(stats::integrateInterval([](double x) { return std::sqrt(x); }, 0, 1), 2.0 / 3, 1e-8);
  EXPECT_NEAR(stats::integrateInterval([](double x) { return x > 0.3 ? 1 : 0; }, 0, 1), 0.7, 1e-7);
}

TEST(Stats, MeansAndLines) {
  const std::vector<double> values = {1, 2, 4, 9};
  const stats::Moments m(values);
  EXPECT_DOUBLE_EQ(m.mean(), 4);
  EXPECT_DOUBLE_EQ(m.variance(), 38.0 / 3);
  EXPECT_NEAR(stats::oneSampleTest(m, 4), 1, 1e-12);
  EXPECT_NEAR(stats::zTest(1.96, 0, 1), 0.04999579, 1e-7);
  EXPECT_DOUBLE_EQ(stats::medianOfMeans(values, 2), 4);
  EXPECT_DOUBLE_EQ(stats::medianOfMeans(std::vector<double>{1, 1, 1, 1, 1e9}, 5), 1);
  const std::vector<double> x = {0, 1, 2, 3}, y = {1, 3.1, 4.9, 7};
  const stats::LineFit fit = stats::fitLine(x, y);
  EXPECT_NEAR(fit.slope, 1.98, 1e-12);
  EXPECT_NEAR(fit.intercept, 1.03, 1e-12);
  EXPECT_NEAR(fit.slopeError, std::sqrt(0.018 / 2 / 5), 1e-12);
}

}  // namespace
}  // namespace virga
