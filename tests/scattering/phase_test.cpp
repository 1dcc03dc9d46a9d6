// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "scattering/phase_checks.h"

namespace virga {
namespace {

using namespace phases;

constexpr float kAsymmetries[] = {-0.99f, -0.85f, -0.3f, -1e-3f, 0.f, 1e-6f, 1e-3f, 0.5f, 0.85f, 0.95f, 0.99f};

// Henyey-Greenstein in double precision; 1 - cos(angle to the peak) as half a squared distance.
double henyeyGreenstein(double g, Vec3 wo, Vec3 wi) {
  const double a = std::fabs(g), side = g < 0 ? -1 : 1;
  double v = 0;
  for (int i = 0; i < 3; ++i) v += 0.5 * std::pow(static_cast<double>(wi[i]) + side * static_cast<double>(wo[i]), 2);
  return kInv4PiDouble * (1 - a * a) / std::pow((1 - a) * (1 - a) + 2 * a * v, 1.5);
}

// Another g, wrong by a few percent of the width of the peak.
float slightlyWrong(float g) { return g + std::copysign(0.06f * (1 - std::fabs(g)), g); }

// What single precision leaves of a value: a direction is known to 1e-7, and the peak is 1 - |g| wide.
double peakTolerance(float g) { return 2e-6 + 1e-6 / static_cast<double>(1 - std::fabs(g)); }

TEST(Isotropic, SamplesFollowTheDensity) {
  EXPECT_GT(samplingP(Isotropic{}, Isotropic{}, kWo), 1e-4);
  const double wrong = stats::chiSquared(
      {}, [](Vec2 u) { return Isotropic{}.sample(kWo, u).wi; },
      [](Vec3 wi) { return HenyeyGreenstein{0.02f}.pdf(kWo, wi); });
  EXPECT_LT(wrong, 1e-4) << "the test cannot fail";
  EXPECT_NEAR(integral(Isotropic{}, kWo), 1, 1e-6);
  EXPECT_NEAR(meanCosine(Isotropic{}, kWo), 0, 1e-6);
  expectConsistentSamples(Isotropic{}, 1e-6);
}

TEST(HenyeyGreenstein, SamplesFollowTheDensity) {
  for (float g : kAsymmetries) {
    EXPECT_GT(samplingP<HenyeyGreenstein>({g}, {g}, kWo), 1e-4) << g;
    EXPECT_LT(samplingP<HenyeyGreenstein>({g}, {slightlyWrong(g)}, kWo), 1e-4) << "the test cannot fail at g = " << g;
  }
}

TEST(HenyeyGreenstein, SamplesFollowTheDensityForEveryDirection) {
  for (Vec3 wo : {Vec3(0, 0, 1), Vec3(0, 0, -1), Vec3(1, 0, 0), Vec3(0, -1, 0), normalize(Vec3(1e-4f, -2e-4f, -1)),
                  normalize(Vec3(-1, 1, -1e-6f))})
    for (float g : {-0.9f, 0.97f}) {
      EXPECT_GT(samplingP<HenyeyGreenstein>({g}, {g}, wo), 1e-4) << g;
    }
}

// The sampled cosine against the closed form of its distribution, with what chi-squared cells cannot see: the ends.
TEST(HenyeyGreenstein, CosinesFollowTheDistribution) {
  for (float g : kAsymmetries) {
    if (std::fabs(g) < 1e-2f) continue;          // the closed form divides by g
    const auto share = [](double a, double v) {  // of 1 - cos(theta) <= v, for a = |g| forward
      const double d = std::sqrt((1 - a) * (1 - a) + 2 * a * v);
      return (1 - a * a) / (2 * a) * (1 / (1 - a) - 1 / d);
    };
    Pcg32 rng(11);
    std::vector<double> heights;
    const Vec3 peak = g > 0 ? -kWo : kWo;
    for (int i = 0; i < 50'000; ++i) {
      const Vec3 d = HenyeyGreenstein{g}.sample(kWo, {rng.next(), rng.next()}).wi - peak;
      heights.push_back(0.5 * lengthSquared(d));
    }
    const auto p = [&](double a) { return stats::kolmogorovSmirnov(heights, [&](double v) { return share(a, v); }); };
    EXPECT_GT(p(std::fabs(g)), 1e-4) << g;
    EXPECT_LT(p(std::fabs(g) + 0.05 * (1 - std::fabs(g))), 1e-4) << "the test cannot fail at g = " << g;
  }
}

TEST(HenyeyGreenstein, ValueIsTheFormula) {
  Pcg32 rng(3);
  for (float g : kAsymmetries)
    for (int i = 0; i < 2000; ++i) {
      const Vec3 wo = uniformSphere({rng.next(), rng.next()});
      // Half of the directions near the peak.
      const Vec3 wi = i % 2 == 0 ? uniformSphere({rng.next(), rng.next()})
                                 : Frame(g > 0 ? -wo : wo).toWorld(uniformCone({rng.next(), rng.next()}, 1e-3f));
      const double expected = henyeyGreenstein(static_cast<double>(g), wo, wi);
      ASSERT_NEAR(HenyeyGreenstein{g}.value(wo, wi), expected, peakTolerance(g) * expected) << g;
    }
}

TEST(HenyeyGreenstein, IntegratesToOneWithMeanCosineG) {
  for (float g : kAsymmetries) {
    EXPECT_NEAR(integral(HenyeyGreenstein{g}, kWo), 1, 1e-4) << g;
    EXPECT_NEAR(meanCosine(HenyeyGreenstein{g}, kWo), static_cast<double>(g), 1e-4) << g;
  }
}

TEST(HenyeyGreenstein, SampledMeanCosineIsG) {
  for (float g : kAsymmetries) {
    stats::Moments cosines;
    Pcg32 rng(5);
    for (int i = 0; i < 100'000; ++i)
      cosines.add(scatteringCosine(kWo, HenyeyGreenstein{g}.sample(kWo, {rng.next(), rng.next()}).wi));
    EXPECT_GT(stats::zTest(cosines.mean(), static_cast<double>(g), cosines.standardError()), 1e-4) << g;
  }
}

TEST(HenyeyGreenstein, SampleAgreesWithValue) {
  for (float g : kAsymmetries) expectConsistentSamples(HenyeyGreenstein{g}, peakTolerance(g), std::to_string(g));
}

TEST(HenyeyGreenstein, ForwardAndBackwardAreMirrorImages) {
  Pcg32 rng(9);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 wo = uniformSphere({rng.next(), rng.next()}), wi = uniformSphere({rng.next(), rng.next()});
    ASSERT_EQ(HenyeyGreenstein{0.99f}.value(wo, wi), HenyeyGreenstein{-0.99f}.value(-wo, wi));
  }
}

TEST(HenyeyGreenstein, RandomNumbersAtTheEndsOfTheirRangeStayFinite) {
  for (float g : {-0.999f, -0.99f, -1e-30f, 0.f, 1e-30f, 0.99f, 0.999f})
    expectSoundEnds(HenyeyGreenstein{g}, std::to_string(g));
}

TEST(CornetteShanks, SamplesFollowTheDensity) {
  for (float g : kAsymmetries) {
    EXPECT_GT(samplingP<CornetteShanks>({g}, {g}, kWo), 1e-4) << g;
    EXPECT_LT(samplingP<CornetteShanks>({g}, {slightlyWrong(g)}, kWo), 1e-4) << "the test cannot fail at g = " << g;
  }
}

TEST(CornetteShanks, IntegratesToOneWithItsMeanCosine) {
  for (float g : kAsymmetries) {
    const double a = static_cast<double>(g);
    EXPECT_NEAR(integral(CornetteShanks{g}, kWo), 1, 2e-4) << g;
    // From the Legendre moments g^l of Henyey-Greenstein, with c^3 = (2 P3 + 3 P1) / 5.
    EXPECT_NEAR(meanCosine(CornetteShanks{g}, kWo), 3 * a * (4 + a * a) / (5 * (2 + a * a)), 2e-4) << g;
  }
}

TEST(CornetteShanks, WeightsAverageToOneAndStayBelowTheirBound) {
  for (float g : kAsymmetries) {
    stats::Moments weights, wrong;
    Pcg32 rng(13);
    for (int i = 0; i < 100'000; ++i) {
      const PhaseSample s = CornetteShanks{g}.sample(kWo, {rng.next(), rng.next()});
      weights.add(static_cast<double>(s.value / s.pdf));
      ASSERT_LE(s.value, 1.50001f * s.pdf);
    }
    EXPECT_GT(stats::zTest(weights.mean(), 1, weights.standardError()), 1e-4) << g;
    EXPECT_LT(stats::zTest(weights.mean(), 1.01, weights.standardError()), 1e-4) << "the test cannot fail at g = " << g;
  }
}

TEST(CornetteShanks, WithoutAsymmetryIsRayleighs) {
  Pcg32 rng(15);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 wi = uniformSphere({rng.next(), rng.next()});
    const double c = scatteringCosine(kWo, wi);
    ASSERT_NEAR(CornetteShanks{0}.value(kWo, wi), 0.75 * kInv4PiDouble * (1 + c * c), 1e-7);
  }
}

TEST(CornetteShanks, SampleAgreesWithValue) {
  for (float g : kAsymmetries) expectConsistentSamples(CornetteShanks{g}, peakTolerance(g), std::to_string(g));
}

TEST(Rayleigh, SamplesFollowTheDensity) {
  EXPECT_GT(samplingP(Rayleigh{}, Rayleigh{}, kWo), 1e-4);
  const double wrong = stats::chiSquared(
      {.axis = -kWo}, [](Vec2 u) { return Rayleigh{}.sample(kWo, u).wi; },
      [](Vec3 wi) { return 0.9 * Rayleigh{}.pdf(kWo, wi) + 0.1 * kInv4PiDouble; });
  EXPECT_LT(wrong, 1e-4) << "the test cannot fail";
  expectConsistentSamples(Rayleigh{}, 2e-6);
  expectSoundEnds(Rayleigh{});
}

TEST(Rayleigh, IntegratesToOneWithMeanCosineZero) {
  EXPECT_NEAR(integral(Rayleigh{}, kWo), 1, 1e-6);
  EXPECT_NEAR(meanCosine(Rayleigh{}, kWo), 0, 1e-6);
}

// The values of Mitsuba 3.9 agree in all digits of single precision.
TEST(Rayleigh, ValueIsTheFormula) {
  expectValues(Rayleigh{}, std::initializer_list<double>{0.119366207, 0.0932548495, 0.065054583, 0.0596831037,
                                                         0.0634132976, 0.081169021, 0.108026418, 0.119366207});
}

// The share of cosines below c is (c^3 + 3 c + 4) / 8.
TEST(Rayleigh, TheCubicIsSolved) {
  for (int i = 0; i <= 1000; ++i) {
    const float u = std::min(static_cast<float>(i) / 1000, 0x1.fffffep-1f);
    const double c = scatteringCosine({0, 0, 1}, Rayleigh{}.sample({0, 0, 1}, {u, 0}).wi);
    ASSERT_NEAR((c * c * c + 3 * c + 4) / 8, static_cast<double>(u), 3e-7) << u;
  }
}

TEST(Schlick, SamplesFollowTheDensity) {
  for (float k : kAsymmetries) {
    EXPECT_GT(samplingP<Schlick>({k}, {k}, kWo), 1e-4) << k;
    EXPECT_LT(samplingP<Schlick>({k}, {slightlyWrong(k)}, kWo), 1e-4) << "the test cannot fail at k = " << k;
    expectConsistentSamples(Schlick{k}, peakTolerance(k), std::to_string(k));
  }
  for (float k : {-0.999f, -1e-30f, 1e-30f, 0.999f}) expectSoundEnds(Schlick{k}, std::to_string(k));
}

TEST(Schlick, IntegratesToOneWithItsMeanCosine) {
  for (float k : kAsymmetries) {
    EXPECT_NEAR(integral(Schlick{k}, kWo), 1, 1e-4) << k;
    const double a = static_cast<double>(k);
    // 1 / k - (1 - k^2) atanh(k) / k^2, whose terms cancel for small k: there its series.
    const double expected =
        std::fabs(a) < 0.01 ? a * (2.0 / 3 + a * a * 2 / 15) : 1 / a - (1 - a * a) * std::atanh(a) / (a * a);
    EXPECT_NEAR(meanCosine(Schlick{k}, kWo), expected, 1e-4) << k;
  }
}

TEST(Schlick, ValueIsTheFormula) {
  expectValues(Schlick{0.6f}, std::initializer_list<double>{0.0198943679, 0.0242233445, 0.0365768327, 0.0509295818,
                                                            0.0704907706, 0.124339799, 0.240688005, 0.318309886});
}

TEST(Schlick, ComesNearToHenyeyAndGreenstein) {
  for (float g : {-0.7f, -0.3f, 0.f, 0.3f, 0.7f}) {
    const Schlick phase{Schlick::likeHenyeyGreenstein(g)};
    EXPECT_NEAR(meanCosine(phase, kWo), static_cast<double>(g), 0.07) << g;
  }
}

TEST(PhaseFunction, ForwardsToWhatItHolds) {
  const Vec3 wi = normalize(Vec3(0.1f, 0.7f, -0.2f));
  const Vec2 u{0.3f, 0.8f};
  const auto expectSame = [&](PhaseFunction held, auto phase) {
    EXPECT_EQ(held.value(kWo, wi), phase.value(kWo, wi));
    EXPECT_EQ(held.pdf(kWo, wi), phase.pdf(kWo, wi));
    EXPECT_EQ(held.sample(kWo, u).wi, phase.sample(kWo, u).wi);
    EXPECT_EQ(held.sample(kWo, u).value, phase.sample(kWo, u).value);
  };
  expectSame(PhaseFunction(), Isotropic{});
  expectSame(PhaseFunction(Isotropic{}), Isotropic{});
  expectSame(PhaseFunction(HenyeyGreenstein{0.6f}), HenyeyGreenstein{0.6f});
  expectSame(PhaseFunction(CornetteShanks{-0.4f}), CornetteShanks{-0.4f});
  expectSame(PhaseFunction(Rayleigh{}), Rayleigh{});
  expectSame(PhaseFunction(Schlick{0.7f}), Schlick{0.7f});
  EXPECT_EQ(PhaseFunction(HenyeyGreenstein{0.6f}), PhaseFunction(HenyeyGreenstein{0.6f}));
  EXPECT_NE(PhaseFunction(HenyeyGreenstein{0.6f}), PhaseFunction(HenyeyGreenstein{0.5f}));
  EXPECT_NE(PhaseFunction(HenyeyGreenstein{0.6f}), PhaseFunction(CornetteShanks{0.6f}));
}

}  // namespace
}  // namespace virga
