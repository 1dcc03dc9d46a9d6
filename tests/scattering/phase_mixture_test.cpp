// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "scattering/phase.h"
#include "scattering/phase_checks.h"

namespace virga {
namespace {

using namespace phases;

const PhaseTable kTable(std::vector<float>{1, 2, 4, 8, 0.5f});
const PlainPhase kLobes[] = {PlainPhase(HenyeyGreenstein{0.8f}), PlainPhase(Rayleigh{}), PlainPhase(kTable.view()),
                             PlainPhase(CornetteShanks{-0.5f})};

PhaseMixture mixture(float a, float b, float c, float d) { return {kLobes, 4, {a, b, c, d}}; }

// Weights of 0 at all places, and one that is all there is.
const PhaseMixture kMixtures[] = {mixture(0.75f, 0.15f, 0.1f, 0),
                                  mixture(0.25f, 0.25f, 0.25f, 0.25f),
                                  mixture(0, 0.5f, 0, 0.5f),
                                  mixture(0, 0, 1, 0),
                                  mixture(1, 0, 0, 0),
                                  mixture(1e-3f, 0.5f, 0.498f, 1e-3f)};

TEST(PhaseMixture, SamplesFollowTheDensity) {
  for (const PhaseMixture& m : kMixtures) {
    PhaseMixture other = m;
    for (float& w : other.weights) w = 0.9f * w + 0.025f;
    EXPECT_GT(samplingP(m, m, kWo), 1e-4);
    if (m.weights[0] != m.weights[1]) {
      EXPECT_LT(samplingP(m, other, kWo), 1e-4) << "the test cannot fail";
    }
  }
}

TEST(PhaseMixture, IntegratesToOneWithTheMeanOfTheMeanCosines) {
  for (const PhaseMixture& m : kMixtures) {
    double expected = 0;
    for (int i = 0; i < m.count; ++i) expected += static_cast<double>(m.weights[i]) * meanCosine(m.lobes[i], kWo);
    EXPECT_NEAR(integral(m, kWo), 1, 1e-4);
    EXPECT_NEAR(meanCosine(m, kWo), expected, 1e-4);
  }
}

// The values of Mitsuba 3.9 for a blendphase (0.25) of hg (0.8) and a blendphase (0.4) of rayleigh and tabphase agree
// to 2e-6, the rounding of its hg at the peak.
TEST(PhaseMixture, ValueIsTheFormula) {
  expectValues(mixture(0.75f, 0.15f, 0.1f, 0),
               std::initializer_list<double>{0.0237471064, 0.021714554, 0.0227613352, 0.0278148924, 0.0380206155,
                                             0.0645194831, 0.260739887, 2.70472361});
}

TEST(PhaseMixture, SampleAgreesWithValue) {
  for (const PhaseMixture& m : kMixtures) {
    expectConsistentSamples(m, 8e-6);
    expectSoundEnds(m);
  }
}

// A lobe whose value is not its density keeps its own weight.
TEST(PhaseMixture, WeightsOfSamplesAverageToOne) {
  const PhaseMixture m = mixture(0, 0, 0, 1), half = mixture(0.5f, 0, 0, 0.5f);
  for (const PhaseMixture& mixed : {m, half}) {
    stats::Moments weights;
    Pcg32 rng(13);
    for (int i = 0; i < 100'000; ++i) {
      const PhaseSample s = mixed.sample(kWo, {rng.next(), rng.next()});
      weights.add(static_cast<double>(s.value / s.pdf));
    }
    EXPECT_GT(weights.standardError(), 0);
    EXPECT_GT(stats::zTest(weights.mean(), 1, weights.standardError()), 1e-4);
    EXPECT_LT(stats::zTest(weights.mean(), 1.01, weights.standardError()), 1e-4) << "the test cannot fail";
  }
}

TEST(PhaseMixture, RoundedWeightsLeaveNoRandomNumberWithoutALobe) {
  const PhaseMixture m = mixture(0.3f, 0.3f, 0.4f - 1e-6f, 0);
  const PhaseSample s = m.sample(kWo, {0x1.fffffep-1f, 0.5f});
  EXPECT_TRUE(isFinite(s.wi) && s.pdf > 0);
}

TEST(PhaseMixture, IsAPhaseFunction) {
  const PhaseFunction held(kMixtures[0]);
  const Vec3 wi = normalize(Vec3(0.1f, 0.7f, -0.2f));
  EXPECT_EQ(held.value(kWo, wi), kMixtures[0].value(kWo, wi));
  EXPECT_EQ(held.pdf(kWo, wi), kMixtures[0].pdf(kWo, wi));
  EXPECT_EQ(held.sample(kWo, {0.9f, 0.1f}).wi, kMixtures[0].sample(kWo, {0.9f, 0.1f}).wi);
  EXPECT_EQ(held, PhaseFunction(kMixtures[0]));
  EXPECT_NE(held, PhaseFunction(kMixtures[1]));
  EXPECT_EQ(PhaseFunction(kTable.view()), PhaseFunction(kTable.view()));
  EXPECT_NE(PhaseFunction(kTable.view()), PhaseFunction(PhaseTable(std::vector<float>{1, 2}).view()));
}

}  // namespace
}  // namespace virga
