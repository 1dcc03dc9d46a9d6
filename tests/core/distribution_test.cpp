// SPDX-License-Identifier: Apache-2.0
#include "core/distribution.h"

#include <gtest/gtest.h>

#include <numeric>

#include "core/random.h"
#include "stats/stats.h"

namespace virga {
namespace {

constexpr float kLast = 0x1.fffffep-1f;  // the largest float below 1

std::vector<double> counts(DiscreteView view, int samples) {
  std::vector<double> out(static_cast<size_t>(view.count), 0.0);
  Pcg32 rng(1);
  for (int i = 0; i < samples; ++i) ++out[static_cast<size_t>(view.sample(rng.next()).index)];
  return out;
}

TEST(Discrete, ItemsComeInProportionToTheirWeights) {
  std::vector<float> weights;
  for (int i = 0; i < 100; ++i) weights.push_back(static_cast<float>(i % 7 * i));
  const Discrete discrete(weights);
  const auto expected = [&](size_t changed, double factor) {
    std::vector<double> e(weights.begin(), weights.end());
    e[changed] *= factor;
    const double total = std::accumulate(e.begin(), e.end(), 0.0);
    for (double& v : e) v *= 2e5 / total;
    return e;
  };
  const std::vector<double> observed = counts(discrete.view(), 200'000);
  EXPECT_GT(stats::chiSquaredCounts(observed, expected(0, 1)), 1e-4);
  EXPECT_LT(stats::chiSquaredCounts(observed, expected(97, 1.2)), 1e-4) << "cannot fail";
  EXPECT_NEAR(discrete.total(), std::accumulate(weights.begin(), weights.end(), 0.0), 1e-9);
  for (int i = 0; i < 100; ++i)
    EXPECT_NEAR(discrete.view().probability(i), weights[static_cast<size_t>(i)] / static_cast<float>(discrete.total()),
                1e-6);
}

TEST(Discrete, WeightZeroIsNeverSampled) {
  const std::vector<std::vector<float>> cases = {
      {0, 1, 2},   {1, 2, 0},    {0, 0, 0, 1, 0, 0, 0}, {1, 0, 0, 1}, {0, 0.1f, 0, 0.7f, 0.2f, 0},
      {1e-30f, 0}, {0, 1e30f, 0}};
  for (const auto& weights : cases) {
    const Discrete discrete(weights);
    Pcg32 rng(3);
    for (int i = -3; i < 10'000; ++i) {
      const float u = i == -3 ? 0 : (i == -2 ? kLast : (i == -1 ? 0x1p-24f : rng.next()));
      const DiscreteView::Sample s = discrete.view().sample(u);
      ASSERT_GT(weights[static_cast<size_t>(s.index)], 0) << u;
      ASSERT_GT(s.probability, 0);
      ASSERT_EQ(s.probability, discrete.view().probability(s.index));
    }
  }
}

TEST(Discrete, ManyEqualItemsAreReachedToTheLast) {
  const std::vector<float> weights(100'000, 0.1f);
  const Discrete discrete(weights);
  EXPECT_EQ(discrete.view().sample(kLast).index, 99'999);
  EXPECT_EQ(discrete.view().sample(0).index, 0);
}

TEST(Discrete, BordersBelongToTheItemAbove) {
  const Discrete discrete(std::vector<float>{1, 1, 2});
  EXPECT_EQ(discrete.view().sample(0.25f).index, 1);
  EXPECT_EQ(discrete.view().sample(0.25f - 0x1p-26f).index, 0);
  EXPECT_EQ(discrete.view().sample(0.5f).index, 2);
}

TEST(Discrete, TheRestOfTheRandomNumberIsUniformInEachItem) {
  const Discrete discrete(std::vector<float>{3, 0, 1, 0.5f});
  std::vector<std::vector<double>> rest(4);
  Pcg32 rng(5);
  for (int i = 0; i < 50'000; ++i) {
    const DiscreteView::Sample s = discrete.view().sample(rng.next());
    ASSERT_TRUE(s.remapped >= 0 && s.remapped < 1);
    rest[static_cast<size_t>(s.index)].push_back(static_cast<double>(s.remapped));
  }
  for (size_t i : {size_t{0}, size_t{2}, size_t{3}})
    EXPECT_GT(stats::kolmogorovSmirnov(rest[i], [](double x) { return x; }), 1e-4) << i;
  EXPECT_LT(discrete.view().sample(kLast).remapped, 1);
}

TEST(Discrete, NothingToSampleIsEmpty) {
  EXPECT_EQ(Discrete(std::vector<float>{}).total(), 0);
  EXPECT_EQ(Discrete(std::vector<float>{}).view().count, 0);
  EXPECT_EQ(Discrete(std::vector<float>{0, 0}).total(), 0);
  EXPECT_EQ(Discrete().total(), 0);
  EXPECT_EQ(Discrete().view().count, 0);
}

}  // namespace
}  // namespace virga
