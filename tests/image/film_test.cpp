// SPDX-License-Identifier: Apache-2.0
#include "image/film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

namespace virga {
namespace {

using Passes = std::vector<std::pair<int, LayerRadiance>>;  // replicate, value of the pixel

LayerRadiance randomRadiance(std::mt19937& random) {
  std::exponential_distribution<float> noise(1);
  LayerRadiance out;
  for (Rgb& v : out.value) v = {noise(random), 3 * noise(random), 0.1f * noise(random)};
  return out;
}

void addPass(Film& film, int replicate, const LayerRadiance& radiance) {
  for (int y = 0; y < film.height(); ++y)
    for (int x = 0; x < film.width(); ++x) film.frame().set(x, y, radiance);
  film.average(replicate);
}

// Mean over all passes and the variance of it, straight from the definition in double.
struct Expected {
  double mean = 0, variance = 0;
};

template <class Value>
Expected expected(const Passes& passes, const Value& value) {
  double sum[Film::kReplicates] = {}, count[Film::kReplicates] = {}, total = 0;
  for (const auto& [replicate, radiance] : passes)
    sum[replicate] += static_cast<double>(value(radiance)), count[replicate] += 1, total += 1;
  Expected out;
  for (const double s : sum) out.mean += s / total;
  double spread = 0, squaredShares = 0;
  for (int r = 0; r < Film::kReplicates; ++r) {
    if (count[r] == 0) continue;
    const double share = count[r] / total;
    spread += std::pow(share * (sum[r] / count[r] - out.mean), 2);
    squaredShares += share * share;
  }
  out.variance = spread / (1 - squaredShares);
  return out;
}

Passes randomPasses(const std::vector<int>& counts) {
  std::mt19937 random(7);
  Passes out;
  for (size_t r = 0; r < counts.size(); ++r)
    for (int i = 0; i < counts[r]; ++i) out.emplace_back(static_cast<int>(r), randomRadiance(random));
  std::shuffle(out.begin(), out.end(), random);
  return out;
}

void expectSameBits(const Image& a, const Image& b) {
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  for (size_t i = 0; i < a.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c)
      ASSERT_EQ(std::bit_cast<uint32_t>(a.pixels[i][c]), std::bit_cast<uint32_t>(b.pixels[i][c])) << i << " " << c;
}

TEST(Film, MeanAndVarianceFollowTheDefinition) {
  const LayerMask some = LayerMask::none().with(Layer::directMedia).with(Layer::mediaToMedia);
  for (const LayerMask mask : {LayerMask::none(), some, LayerMask::all()})
    for (const auto& counts :
         std::vector<std::vector<int>>{{4, 4, 4, 4, 4, 4, 4, 4}, {9, 1, 4}, {2, 1}, {3, 3, 3, 2, 2, 2, 2, 2}}) {
      const Passes passes = randomPasses(counts);
      Film film(3, 2, mask);
      for (const auto& [replicate, radiance] : passes) addPass(film, replicate, radiance);
      ASSERT_TRUE(film.hasVariance());
      for (int c = 0; c < 3; ++c) {
        const Expected beauty = expected(passes, [c](const LayerRadiance& l) { return l.sum()[c]; });
        EXPECT_NEAR(static_cast<double>(film.beauty().at(2, 1)[c]), beauty.mean, 2e-6 * beauty.mean);
        EXPECT_NEAR(static_cast<double>(film.beautyVariance().at(2, 1)[c]), beauty.variance, 1e-4 * beauty.variance);
        if (!mask.has(Layer::directMedia)) continue;
        const Expected layer = expected(passes, [c](const LayerRadiance& l) { return l.value[2][c]; });
        EXPECT_NEAR(static_cast<double>(film.layer(Layer::directMedia).at(0, 0)[c]), layer.mean, 2e-6 * layer.mean);
        EXPECT_NEAR(static_cast<double>(film.layerVariance(Layer::directMedia).at(0, 0)[c]), layer.variance,
                    1e-4 * layer.variance);
      }
    }
}

// The variance's expectation against the spread of many films' means: what "unbiased" claims. Counts and the noise of a
// replicate as the film's derivation has them.
TEST(Film, VarianceIsUnbiased) {
  struct Case {
    std::vector<int> counts;
    std::vector<float> sigma;  // of a pass, by replicate
  };
  const std::vector<Case> cases = {
      {{2, 2, 2}, {1, 1, 1}}, {{2, 2, 2}, {0.1f, 1, 3}}, {{5, 2, 1}, {1, 1, 1}}, {{2, 1}, {1, 1}}};
  std::mt19937 random(11);
  std::normal_distribution<float> normal;
  for (const Case& test : cases) {
    // Pixels are independent, so that one film of many pixels is many films.
    Film film(200, 200, LayerMask::none());
    for (size_t r = 0; r < test.counts.size(); ++r)
      for (int i = 0; i < test.counts[r]; ++i) {
        for (int y = 0; y < film.height(); ++y)
          for (int x = 0; x < film.width(); ++x) {
            LayerRadiance radiance;
            for (int c = 0; c < 3; ++c) radiance.value[0][c] = 1 + test.sigma[r] * normal(random);
            film.frame().set(x, y, radiance);
          }
        film.average(static_cast<int>(r));
      }
    const Image mean = film.beauty(), variance = film.beautyVariance();
    double spread = 0, claimed = 0;
    for (size_t i = 0; i < mean.pixels.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        spread += std::pow(static_cast<double>(mean.pixels[i][c]) - 1, 2);
        claimed += static_cast<double>(variance.pixels[i][c]);
      }
    EXPECT_NEAR(claimed / spread, 1, 0.025) << test.counts.size() << " replicates of " << test.counts[0] << "...";
    // The plain weights R / (R - 1) for unequal counts would be 11 % off for counts of 2 and 1, and be caught.
  }
}

TEST(Film, BeautyIsTheSumOfItsLayersBitForBit) {
  Film film(7, 5, LayerMask::all());
  std::mt19937 random(3);
  for (int pass = 0; pass < 11; ++pass) {
    for (int y = 0; y < 5; ++y)
      for (int x = 0; x < 7; ++x) film.frame().set(x, y, randomRadiance(random));
    film.average(pass % 3);
  }
  const auto sumOf = [](const auto& layer) {
    Image sum(7, 5);
    for (int i = 0; i < kLayerCount; ++i) {
      const Image plane = layer(static_cast<Layer>(i));
      for (size_t p = 0; p < sum.pixels.size(); ++p) sum.pixels[p] += plane.pixels[p];
    }
    return sum;
  };
  expectSameBits(film.beauty(), sumOf([&](Layer l) { return film.layer(l); }));
  for (int r = 0; r < 4; ++r)  // the last of them is empty
    expectSameBits(film.replicateBeauty(r), sumOf([&](Layer l) { return film.replicateLayer(r, l); }));
}

TEST(Film, RunningMeanStaysAccurate) {
  constexpr int kPasses = 100'000;
  Film film(1, 1, LayerMask::none());
  std::mt19937 random(5);
  std::exponential_distribution<float> noise(1);
  double sum[3] = {};
  float plain = 0;
  for (int i = 0; i < kPasses; ++i) {
    LayerRadiance radiance;
    radiance.value[0] = {1000 + noise(random), noise(random), 0.1f};
    for (int c = 0; c < 3; ++c) sum[c] += static_cast<double>(radiance.value[0][c]);
    plain += radiance.value[0].r;
    film.frame().set(0, 0, radiance);
    film.average(0);
  }
  const Rgb mean = film.beauty().at(0, 0);
  for (int c = 0; c < 2; ++c) EXPECT_NEAR(static_cast<double>(mean[c]) * kPasses / sum[c], 1, 1e-5) << c;
  EXPECT_EQ(mean.b, 0.1f) << "equal samples have exactly that mean";
  EXPECT_GT(std::abs(static_cast<double>(plain) / sum[0] - 1), 1e-5) << "the test cannot tell a plain float sum";
}

TEST(Film, AbortedPassLeavesNoTrace) {
  Film film(4, 4, LayerMask::all());
  std::mt19937 random(1);
  for (int r = 0; r < 3; ++r) addPass(film, r, randomRadiance(random));
  const Image beauty = film.beauty(), variance = film.beautyVariance();
  for (int x = 0; x < 4; ++x) film.frame().set(x, 0, randomRadiance(random));
  film.frame().set(0, 1, {{Rgb(std::nanf(""))}});
  expectSameBits(film.beauty(), beauty);
  expectSameBits(film.beautyVariance(), variance);
  EXPECT_EQ(film.passes(), 3);
  EXPECT_EQ(film.nonFiniteSamples(), 0u);
  // And a pass that follows and fills the frame is not affected by it either.
  Film undisturbed(4, 4, LayerMask::all());
  std::mt19937 again(1);
  for (int r = 0; r < 3; ++r) addPass(undisturbed, r, randomRadiance(again));
  const LayerRadiance next = randomRadiance(again);
  addPass(film, 3, next);
  addPass(undisturbed, 3, next);
  expectSameBits(film.beauty(), undisturbed.beauty());
}

TEST(Film, NonFiniteSamplesAreCountedAndStay) {
  for (const LayerMask mask : {LayerMask::none(), LayerMask::none().with(Layer::emission), LayerMask::all()}) {
    Film film(100, 90, mask);
    addPass(film, 0, {{Rgb(1)}});
    film.frame().set(99, 89, {{Rgb(1, std::nanf(""), 1)}});
    film.frame().set(0, 0, {{Rgb(kInfinity, 1, kInfinity)}});
    film.average(0);
    film.frame().set(99, 89, {{Rgb(1)}});
    film.frame().set(0, 0, {{Rgb(1)}});
    film.average(1);
    EXPECT_EQ(film.nonFiniteSamples(), 2u);
    EXPECT_TRUE(std::isnan(film.beauty().at(99, 89).g));
    EXPECT_EQ(film.beauty().at(99, 89).r, 1);
    EXPECT_FALSE(std::isfinite(film.beauty().at(0, 0).b));
    ASSERT_TRUE(film.estimatedRelMse()) << "two bad pixels do not hide the others";
    EXPECT_EQ(*film.estimatedRelMse(), 0);
    film.clear();
    EXPECT_EQ(film.nonFiniteSamples(), 0u);
    EXPECT_EQ(film.beauty().at(99, 89), Rgb());
  }
}

TEST(Film, ReplaceForgetsWhatWasAveraged) {
  Film film(2, 2, LayerMask::none().with(Layer::emission));
  for (int r = 0; r < 4; ++r) addPass(film, r, {{Rgb(5)}});
  for (int i = 1; i <= 2; ++i) {
    for (int p = 0; p < 4; ++p) film.frame().set(p % 2, p / 2, {{Rgb(static_cast<float>(i))}});
    film.replace();
    EXPECT_EQ(film.beauty().at(1, 1), Rgb(static_cast<float>(i)));
    EXPECT_EQ(film.layer(Layer::emission).at(0, 1), Rgb(static_cast<float>(i)));
    EXPECT_FALSE(film.hasVariance());
    EXPECT_FALSE(film.estimatedRelMse());
    EXPECT_EQ(film.passes(), 4 + i);
    EXPECT_EQ(film.passesOf(0), 1);
    EXPECT_EQ(film.passesOf(3), 0);
  }
}

TEST(Film, EmptyFilmIsBlack) {
  const Film film(2, 3, LayerMask::all());
  EXPECT_EQ(film.beauty().at(1, 2), Rgb());
  EXPECT_EQ(film.replicateBeauty(7).at(1, 2), Rgb());
  EXPECT_FALSE(film.hasVariance());
  EXPECT_FALSE(film.estimatedRelMse());
  EXPECT_EQ(film.passes(), 0);
}

// Pixels of known mean and noise: the estimate against the error that the film really has.
TEST(Film, EstimatedErrorIsTheRealOne) {
  const auto ratio = [](float common) {
    Film film(256, 128, LayerMask::none());
    std::mt19937 random(17);
    std::normal_distribution<float> normal;
    const auto truth = [](int x, int c) { return 0.02f + 0.01f * static_cast<float>(x * (c + 1)); };
    for (int pass = 0; pass < 20; ++pass) {  // counts of 3 and 2
      for (int y = 0; y < film.height(); ++y)
        for (int x = 0; x < film.width(); ++x) {
          LayerRadiance radiance;
          for (int c = 0; c < 3; ++c) radiance.value[4][c] = truth(x, c) * (1 + 0.3f * normal(random)) + common;
          film.frame().set(x, y, radiance);
        }
      film.average(pass % Film::kReplicates);
    }
    double error = 0;
    const Image beauty = film.beauty();
    for (int y = 0; y < film.height(); ++y)
      for (int x = 0; x < film.width(); ++x)
        for (int c = 0; c < 3; ++c) {
          const double b = static_cast<double>(truth(x, c)), d = static_cast<double>(beauty.at(x, y)[c]) - b;
          error += d * d / (b * b + 0.01);
        }
    return *film.estimatedRelMse() / (error / (3.0 * 256 * 128));
  };
  EXPECT_NEAR(ratio(0), 1, 0.03);
  EXPECT_LT(ratio(0.1f), 0.8) << "an error that all replicates share cannot show, or the test cannot fail";
}

// A rare bright sample must not hide in the mean that it has raised itself.
TEST(Film, EstimatedErrorOfFirefliesIsTheRealOne) {
  Film film(512, 256, LayerMask::none());
  std::mt19937 random(18);
  constexpr double kLevel = 0.5, kRarity = 0.01;
  std::bernoulli_distribution bright(kRarity);
  std::normal_distribution<float> normal;
  for (int pass = 0; pass < 2 * Film::kReplicates; ++pass) {
    for (int y = 0; y < film.height(); ++y)
      for (int x = 0; x < film.width(); ++x) {
        LayerRadiance radiance;
        const float firefly = bright(random) ? static_cast<float>(0.5 * kLevel / kRarity) : 0;
        radiance.value[4] = Rgb(static_cast<float>(0.5 * kLevel) + 0.1f * normal(random) + firefly);
        film.frame().set(x, y, radiance);
      }
    film.average(pass % Film::kReplicates);
  }
  double error = 0;
  for (const Rgb& p : film.beauty().pixels) {
    const double d = static_cast<double>(p.g) - kLevel;
    error += d * d / (kLevel * kLevel + 0.01);
  }
  error /= 512 * 256;
  // The true level is not to be had from 16 samples of such noise: 0.25 at most pixels. Better twice too high than low.
  EXPECT_GT(*film.estimatedRelMse(), 0.9 * error);
  EXPECT_LT(*film.estimatedRelMse(), 3.5 * error);
}

}  // namespace
}  // namespace virga
