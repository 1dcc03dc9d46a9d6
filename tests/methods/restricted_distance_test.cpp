// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/restricted_distance.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "stats/stats.h"

namespace virga {
namespace {

/// From next to no extinction to 500 mean free paths within the radius.
constexpr RestrictedDistance kCases[] = {{0, 0.5f},    {1e-9f, 2},  {1e-6f, 1}, {1.1e-6f, 1}, {1e-3f, 0.1f},
                                         {0.7f, 1.5f}, {10, 0.25f}, {4, 10},    {1000, 0.1f}, {500, 1}};

std::string nameOf(const RestrictedDistance& r) { return fmt::format("s {} d {}", r.s, r.d); }

double samplingP(const RestrictedDistance& sampled, const RestrictedDistance& claimed) {
  Pcg32 random(99);  // not the seed of the test's own numbers
  const auto d = static_cast<double>(sampled.d);
  return stats::chiSquaredInterval(
      {.lo = 0, .hi = d, .samples = 100'000},
      [&](float u) -> std::optional<double> {
        return static_cast<double>(sampled.sample({u, random.next()}));
      },
      [&](double t) { return t >= 0 && t <= d ? static_cast<double>(claimed.pdf(static_cast<float>(t))) : 0; });
}

TEST(RestrictedDistance, SamplesFollowTheDensity) {
  for (const RestrictedDistance& r : kCases) EXPECT_GT(samplingP(r, r), 1e-4) << nameOf(r);
}
TEST(RestrictedDistance, AnotherDensityIsNoticed) {
  for (const RestrictedDistance& r : kCases) {
    if (!(r.s * r.d > 0.1f)) continue;
    EXPECT_LT(samplingP(r, {r.s * 1.15f, r.d}), 1e-4) << nameOf(r);
  }
  EXPECT_LT(samplingP({0, 1}, {0.2f, 1}), 1e-4) << "uniform";
}

TEST(RestrictedDistance, DensityIntegratesToOne) {
  for (const RestrictedDistance& r : kCases) {
    // Two parts: the adaptive rule must not miss a peak at 0.
    const auto d = static_cast<double>(r.d), knee = std::min(d, 10 / (static_cast<double>(r.s) + 1e-9));
    const auto pdf = [&](double t) { return static_cast<double>(r.pdf(static_cast<float>(t))); };
    double sum = stats::integrateInterval(pdf, 0, knee, 1e-6);
    if (knee < d) sum += stats::integrateInterval(pdf, knee, d, 1e-6);
    EXPECT_NEAR(sum, 1, 2e-5) << nameOf(r);
  }
}

TEST(RestrictedDistance, BeyondIsTheRestOfTheDensity) {
  for (const RestrictedDistance& r : kCases) {
    EXPECT_NEAR(r.beyond(0), 1, 1e-6f) << nameOf(r);
    EXPECT_NEAR(r.beyond(r.d), 0, 1e-6f) << nameOf(r);
    for (const double share : {0.001, 0.01, 0.1, 0.3, 0.7, 0.99}) {
      const double t = share * static_cast<double>(r.d);
      const double before = stats::integrateInterval(
          [&](double x) { return static_cast<double>(r.pdf(static_cast<float>(x))); }, 0, t, 3e-6);
      EXPECT_NEAR(r.beyond(static_cast<float>(t)), 1 - before, 2e-5) << nameOf(r) << " at " << t;
    }
  }
}

// Half uniform, half a free flight that is known to end before d.
TEST(RestrictedDistance, IsTheMixtureThatItSays) {
  for (const RestrictedDistance& r : kCases)
    for (const double share : {0.0, 0.2, 0.9}) {
      const double s = static_cast<double>(r.s), d = static_cast<double>(r.d), t = share * d;
      const double flight = s * d > 1e-12 ? s * std::exp(-s * t) / -std::expm1(-s * d) : 1 / d;
      EXPECT_NEAR(r.pdf(static_cast<float>(t)) * r.d, 0.5 + 0.5 * flight * d, 1e-5 * (1 + flight * d)) << nameOf(r);
    }
}

TEST(RestrictedDistance, NothingIsOutOfRange) {
  for (const RestrictedDistance& r : kCases)
    for (const float u : {0.f, 1e-30f, 0.5f, 0x1.fffffep-1f})
      for (const float choice : {0.f, 0.49f, 0.5f, 0x1.fffffep-1f}) {
        const float t = r.sample({u, choice});
        EXPECT_TRUE(t >= 0 && t <= r.d) << nameOf(r) << ": " << t;
        EXPECT_TRUE(r.pdf(t) >= 0.49f / r.d && std::isfinite(r.pdf(t))) << nameOf(r);
        EXPECT_TRUE(r.beyond(t) >= -1e-6f && r.beyond(t) <= 1 + 1e-6f) << nameOf(r);
      }
}

}  // namespace
}  // namespace virga
