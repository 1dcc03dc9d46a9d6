// SPDX-License-Identifier: Apache-2.0
// What every phase function must pass.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <span>

#include "core/random.h"
#include "scattering/phase.h"
#include "stats/stats.h"

namespace virga::phases {

inline constexpr double kInv4PiDouble = 0.079577471545947667;

inline const Vec3 kWo = normalize(Vec3(0.3f, -0.5f, 0.8f));

inline double scatteringCosine(Vec3 wo, Vec3 wi) {
  return -(static_cast<double>(wo.x) * wi.x + static_cast<double>(wo.y) * wi.y + static_cast<double>(wo.z) * wi.z);
}

template <class Phase>
double samplingP(Phase drawn, Phase claimed, Vec3 wo) {
  return stats::chiSquared(
      {.axis = -wo}, [&](Vec2 u) { return drawn.sample(wo, u).wi; }, [&](Vec3 wi) { return claimed.pdf(wo, wi); });
}

template <class Phase>
double integral(Phase phase, Vec3 wo) {
  return stats::integrateSphere([&](Vec3 wi) { return phase.value(wo, wi); }, -wo);
}

template <class Phase>
double meanCosine(Phase phase, Vec3 wo) {
  return stats::integrateSphere([&](Vec3 wi) { return phase.value(wo, wi) * scatteringCosine(wo, wi); }, -wo);
}

template <class Phase>
void expectConsistentSamples(Phase phase, double relative, const std::string& what = "") {
  Pcg32 rng(7);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wo = uniformSphere({rng.next(), rng.next()});
    const PhaseSample s = phase.sample(wo, {rng.next(), rng.next()});
    const float tolerance = static_cast<float>(relative);
    ASSERT_NEAR(length(s.wi), 1, 1e-6) << what;
    ASSERT_NEAR(s.pdf, phase.pdf(wo, s.wi), tolerance * s.pdf) << what;
    ASSERT_NEAR(s.value, phase.value(wo, s.wi), tolerance * s.value) << what;
    ASSERT_EQ(phase.value(wo, s.wi), phase.value(s.wi, wo)) << "reciprocity, g = " << what;
  }
}

inline constexpr float kCosines[] = {-1.f, -0.75f, -0.3f, 0.f, 0.25f, 0.6f, 0.9f, 1.f};

/// The values at kCosines.
template <class Phase>
void expectValues(Phase phase, std::span<const double> expected, double relative = 1e-6) {
  for (size_t i = 0; i < expected.size(); ++i) {
    const float c = kCosines[i];
    const float value = phase.value({0, 0, 1}, {std::sqrt(1 - c * c), 0, -c});
    EXPECT_NEAR(value, expected[i], relative * expected[i]) << "at cosine " << c;
  }
}

/// Random numbers at the ends of their range must do no harm.
template <class Phase>
void expectSoundEnds(Phase phase, const std::string& what = "") {
  for (float x : {0.f, 0x1p-24f, 0.25f, 0.5f, 0.75f, 0x1.fffffep-1f})
    for (Vec3 wo : {kWo, Vec3(0, 0, 1), Vec3(0, 0, -1)}) {
      const PhaseSample s = phase.sample(wo, {x, x});
      EXPECT_TRUE(isFinite(s.wi) && std::isfinite(s.pdf) && std::isfinite(s.value) && s.pdf > 0) << what << " " << x;
      EXPECT_NEAR(length(s.wi), 1, 1e-6) << what;
    }
}

}  // namespace virga::phases
