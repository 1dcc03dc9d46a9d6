// SPDX-License-Identifier: Apache-2.0
#include "scattering/phase_table.h"

#include <gtest/gtest.h>

#include "scattering/phase_checks.h"

namespace virga {
namespace {

using namespace phases;

using Values = std::vector<float>;

// Some that are 0 at an end, inside, and at both ends of a piece; very uneven; without a peak; as short as can be.
const Values kTables[] = {{1, 2, 4, 8, 0.5f}, {0, 1},   {3, 0}, {0, 0, 5, 0, 0, 1, 0}, {1, 1},
                          {1e-3f, 1, 1e3f},   {2, 0, 2}};

std::string text(const Values& values) {
  std::string result;
  for (const float v : values) result += std::to_string(v) + " ";
  return result;
}

double integralOf(const Values& values) {
  return stats::integrateSphere([&, table = PhaseTable(values)](Vec3 wi) { return table.view().value(kWo, wi); }, -kWo);
}

TEST(PhaseTable, SamplesFollowTheDensity) {
  for (const Values& values : kTables) {
    const PhaseTable table(values);
    Values other = values;
    (other.front() < other.back() ? other.front() : other.back()) +=
        0.1f * *std::max_element(values.begin(), values.end());
    EXPECT_GT(samplingP(table.view(), table.view(), kWo), 1e-4) << text(values);
    EXPECT_LT(samplingP(table.view(), PhaseTable(other).view(), kWo), 1e-4) << "the test cannot fail: " << text(values);
  }
}

TEST(PhaseTable, IntegratesToOne) {
  for (const Values& values : kTables) EXPECT_NEAR(integralOf(values), 1, 1e-4) << text(values);
}

// Single precision neither overflows nor vanishes on the way: only ratios count.
TEST(PhaseTable, TheUnitOfTheValuesDoesNotMatter) {
  for (const float unit : {1e-38f, 1.f, 1e37f}) {
    const PhaseTable table(Values{unit, 2 * unit, 4 * unit, 8 * unit, 0.5f * unit});
    EXPECT_NEAR(table.view().value(kWo, kWo), 0.0215803313, 1e-7) << unit;
    EXPECT_NEAR(integralOf({unit, 2 * unit, 4 * unit, 8 * unit, 0.5f * unit}), 1, 1e-4) << unit;
  }
}

TEST(PhaseTable, MeanCosine) {
  // Of the piecewise linear function by hand: 1.39583 / 7.375.
  EXPECT_NEAR(meanCosine(PhaseTable(kTables[0]).view(), kWo), 0.189265537, 1e-4);
  EXPECT_NEAR(meanCosine(PhaseTable(Values{0, 1}).view(), kWo), 1. / 3, 1e-4);
}

// The values of Mitsuba 3.9's tabphase agree to 2e-7: the first value is the one of backward scattering.
TEST(PhaseTable, ValueIsTheFormula) {
  expectValues(PhaseTable(kTables[0]).view(),
               std::initializer_list<double>{0.0215803313, 0.0323704969, 0.0604249275, 0.0863213251, 0.129481988,
                                             0.140272153, 0.0431606625, 0.0107901656});
}

// Where the function falls to 0, values keep no relative accuracy.
TEST(PhaseTable, SampleAgreesWithValue) {
  for (const Values& values : {Values{1, 2, 4, 8, 0.5f}, Values{1, 1}, Values{3, 2, 1}})
    expectConsistentSamples(PhaseTable(values).view(), 1e-5, text(values));
}

TEST(PhaseTable, RandomNumbersAtTheEndsOfTheirRangeNeverFindZero) {
  for (const Values& values : kTables) expectSoundEnds(PhaseTable(values).view(), text(values));
}

// A fine table of Henyey and Greenstein's function is sampled like that function.
TEST(PhaseTable, AFineTableIsTheFunctionItWasMadeFrom) {
  Values values;
  constexpr int kCount = 4001;
  for (int i = 0; i < kCount; ++i) {
    const float c = -1 + 2 * static_cast<float>(i) / (kCount - 1);
    values.push_back(HenyeyGreenstein{0.7f}.value({0, 0, 1}, {std::sqrt(std::max(0.f, 1 - c * c)), 0, -c}));
  }
  const PhaseTable table(values);
  const auto p = [&](float g) {
    return stats::chiSquared(
        {.axis = -kWo}, [&](Vec2 u) { return table.view().sample(kWo, u).wi; },
        [&](Vec3 wi) { return HenyeyGreenstein{g}.pdf(kWo, wi); });
  };
  EXPECT_GT(p(0.7f), 1e-4);
  EXPECT_LT(p(0.71f), 1e-4) << "the test cannot fail";
}

}  // namespace
}  // namespace virga
