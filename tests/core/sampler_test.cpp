// SPDX-License-Identifier: Apache-2.0
#include "core/sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "stats/stats.h"

namespace virga {
namespace {

// The `pair`-th next2D (from 0) of sample `index`.
Vec2 pairOf(SampleId id, int pair) {
  Sampler sampler(id);
  for (int i = 0; i < pair; ++i) sampler.next2D();
  return sampler.next2D();
}

// True where each elementary interval of area 1 / n holds one of the n = 2^k points.
bool isNet(const std::vector<Vec2>& points) {
  const auto n = static_cast<int>(points.size());
  for (int columns = 1; columns <= n; columns *= 2) {
    const int rows = n / columns;
    std::vector<bool> taken(points.size(), false);
    for (Vec2 p : points) {
      const int cell =
          static_cast<int>(p.x * static_cast<float>(columns)) * rows + static_cast<int>(p.y * static_cast<float>(rows));
      if (taken[static_cast<size_t>(cell)]) return false;
      taken[static_cast<size_t>(cell)] = true;
    }
  }
  return true;
}

std::vector<Vec2> block(uint32_t begin, uint32_t count, int pair, uint32_t stream = 5) {
  std::vector<Vec2> points;
  for (uint32_t i = begin; i < begin + count; ++i) points.push_back(pairOf({77, 0, stream, i}, pair));
  return points;
}

TEST(Sobol, TheUnscrambledPointsAreANet) {
  std::vector<Vec2> points;
  for (uint32_t i = 0; i < 256; ++i) points.push_back({toUnitFloat(reverseBits(i)), toUnitFloat(sobolSecond(i))});
  EXPECT_TRUE(isNet(points));
  std::swap(points[3].x, points[4].x);
  EXPECT_FALSE(isNet(points)) << "the test cannot fail";
}

TEST(OwenScramble, KeepsElementaryIntervalsTogether) {
  Pcg32 rng(1);
  for (int i = 0; i < 1000; ++i) {
    const uint32_t seed = rng.nextBits(), a = rng.nextBits(), shared = rng.nextBits() % 32;
    const uint32_t b = a ^ (0x80000000u >> shared);  // the first difference
    const uint32_t difference = owenScramble(a, seed) ^ owenScramble(b, seed);
    ASSERT_EQ(difference >> (31 - shared), 1u);
  }
}

TEST(Sampler, EveryPairIsANetInEveryAlignedBlock) {
  for (uint32_t count : {1u, 2u, 4u, 16u, 64u, 256u, 1024u})
    for (uint32_t which : {0u, 1u, 2u, 3u, 7u, 1000u})
      for (int pair : {0, 1, 5, 20})
        ASSERT_TRUE(isNet(block(which * count, count, pair))) << count << " " << which << " " << pair;
}

TEST(Sampler, OneDimensionIsStratifiedInEveryAlignedBlock) {
  for (uint32_t count : {2u, 16u, 256u})
    for (uint32_t which : {0u, 1u, 9u}) {
      std::set<int> taken;
      for (uint32_t i = which * count; i < (which + 1) * count; ++i) {
        Sampler sampler({3, 1, 2, i});
        sampler.next2D();
        taken.insert(static_cast<int>(sampler.next1D() * static_cast<float>(count)));
      }
      EXPECT_EQ(taken.size(), count);
    }
}

TEST(Sampler, ErrorsFallFasterThanThoseOfRandomNumbers) {
  // Spread over replicates of the mean of a smooth function, against the number of samples.
  const auto slope = [](auto draw) {
    std::vector<double> x, y;
    for (uint32_t n = 16; n <= 1024; n *= 4) {
      stats::Moments means;
      for (uint32_t replicate = 0; replicate < 64; ++replicate) {
        double sum = 0;
        for (uint32_t i = 0; i < n; ++i) {
          Sampler sampler({1, replicate, 0, i});
          const Vec2 u = draw(sampler);
          sum += static_cast<double>(std::sin(3 * u.x) * std::exp(u.y));
        }
        means.add(sum / n);
      }
      x.push_back(std::log2(n)), y.push_back(0.5 * std::log2(means.variance()));
    }
    return stats::fitLine(x, y);
  };
  const stats::LineFit stratified = slope([](Sampler& s) { return s.next2D(); });
  const stats::LineFit independent = slope([](Sampler& s) { return s.random2D(); });
  EXPECT_LT(stratified.slope, -1.2) << "scrambled nets reach -1.5 for smooth functions";
  EXPECT_NEAR(independent.slope, -0.5, 0.1);
}

// Largest |correlation| that chance allows (5 standard errors) between n pairs of numbers.
double chance(int n) { return 5 / std::sqrt(static_cast<double>(n)); }

class Correlation {
 public:
  void add(float a, float b) {
    const double x = static_cast<double>(a) - 0.5, y = static_cast<double>(b) - 0.5;
    sum_ += 12 * x * y, ++count_;
  }
  double value() const { return sum_ / count_; }
  bool plausible() const { return std::fabs(value()) < chance(count_); }

 private:
  double sum_ = 0;
  int count_ = 0;
};

TEST(Sampler, FirstSampleIsUniformAcrossPixels) {
  for (uint32_t index : {0u, 1u, 6u})
    for (int pair : {0, 1, 4}) {
      uint32_t pixel = 0;
      const auto draw = [&](Vec2) { return pairOf({42, 0, pixel++, index}, pair); };
      EXPECT_GT(stats::chiSquaredSquare({.samples = 100'000}, draw, [](Vec2) { return 1; }), 1e-4)
          << index << " " << pair;
    }
}

TEST(Sampler, NoTintFromLeftToRight) {
  for (uint32_t index : {0u, 1u, 2u, 255u}) {
    Correlation x, y, neighbours, row;
    constexpr uint32_t kWidth = 256, kPixels = kWidth * kWidth;
    for (uint32_t pixel = 0; pixel < kPixels; ++pixel) {
      const Vec2 u = pairOf({42, 0, pixel, index}, 0);
      const float column = (static_cast<float>(pixel % kWidth) + 0.5f) / kWidth;
      x.add(u.x, column), y.add(u.y, column);
      neighbours.add(u.x, pairOf({42, 0, pixel + 1, index}, 0).x);
      row.add(u.y, pairOf({42, 0, pixel + kWidth, index}, 0).y);
    }
    EXPECT_TRUE(x.plausible()) << index << " " << x.value();
    EXPECT_TRUE(y.plausible()) << index << " " << y.value();
    EXPECT_TRUE(neighbours.plausible()) << index << " " << neighbours.value();
    EXPECT_TRUE(row.plausible()) << index << " " << row.value();
  }
}

TEST(Sampler, MeansOfPixelsScatterNoMoreThanChanceAllows) {
  // The squared deviations of pixels' means of 16 samples: shared scrambles would make all deviate alike.
  stats::Moments means;
  for (uint32_t pixel = 0; pixel < 4096; ++pixel) {
    double sum = 0;
    for (uint32_t i = 0; i < 16; ++i) sum += static_cast<double>(pairOf({4, 2, pixel, i}, 3).y);
    means.add(sum / 16);
  }
  EXPECT_GT(stats::oneSampleTest(means, 0.5), 1e-4);
  EXPECT_LT(stats::oneSampleTest(means, 0.502), 1e-4) << "the test cannot fail";
}

TEST(Sampler, ReplicatesPixelsSeedsAndDimensionsAreUncorrelated) {
  const auto expectIndependent = [](const char* what, auto a, auto b) {
    Correlation same, crossed;
    for (uint32_t i = 0; i < 20'000; ++i) {
      const Vec2 u = a(i), v = b(i);
      same.add(u.x, v.x), same.add(u.y, v.y), crossed.add(u.x, v.y), crossed.add(u.y, v.x);
    }
    EXPECT_TRUE(same.plausible()) << what << " " << same.value();
    EXPECT_TRUE(crossed.plausible()) << what << " " << crossed.value();
  };
  const auto base = [](uint32_t i) { return pairOf({9, 3, i / 16, i % 16}, 1); };
  expectIndependent("replicates", base, [](uint32_t i) { return pairOf({9, 4, i / 16, i % 16}, 1); });
  expectIndependent(
      "replicate 0",
      [](uint32_t i) {
        return pairOf({9, 0, i / 16, i % 16}, 1);
      },
      base);
  expectIndependent("pixels", base, [](uint32_t i) { return pairOf({9, 3, i / 16 + 1, i % 16}, 1); });
  expectIndependent("seeds", base, [](uint32_t i) { return pairOf({10, 3, i / 16, i % 16}, 1); });
  expectIndependent("seed for replicate", base, [](uint32_t i) { return pairOf({3, 9, i / 16, i % 16}, 1); });
  for (int pair : {0, 2, 3, 12})
    expectIndependent("pairs", base, [&](uint32_t i) { return pairOf({9, 3, i / 16, i % 16}, pair); });
}

TEST(Sampler, ProjectionsAcrossPairsLookRandom) {
  // One pixel, many samples: (x of one pair, x of another) must fill the square, as padding promises.
  for (auto [a, b] : {std::pair(0, 1), {0, 2}, {1, 2}, {3, 17}}) {
    uint32_t i = 0;
    const auto draw = [&](Vec2) {
      const SampleId id{8, 0, 31, i++};
      return Vec2{pairOf(id, a).x, pairOf(id, b).y};
    };
    EXPECT_GT(stats::chiSquaredSquare({.samples = 65'536}, draw, [](Vec2) { return 1; }), 1e-4) << a << " " << b;
  }
}

TEST(Sampler, RandomStreamIsUniformAndIndependentOfThePoints) {
  Correlation points, samples, pixels;
  stats::Moments mean;
  for (uint32_t i = 0; i < 50'000; ++i) {
    Sampler here({5, 0, i / 64, i % 64}), nextSample({5, 0, i / 64, i % 64 + 1}), nextPixel({5, 0, i / 64 + 1, i % 64});
    const float r = here.random();
    mean.add(static_cast<double>(r));
    points.add(r, here.next2D().x), samples.add(r, nextSample.random()), pixels.add(r, nextPixel.random());
  }
  EXPECT_GT(stats::oneSampleTest(mean, 0.5), 1e-4);
  for (const Correlation& c : {points, samples, pixels}) EXPECT_TRUE(c.plausible()) << c.value();
}

TEST(Sampler, IsAFunctionOfItsName) {
  Sampler a({1, 2, 3, 4}), b({1, 2, 3, 4});
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(a.next2D(), b.next2D());
    EXPECT_EQ(a.next1D(), b.next1D());
    EXPECT_EQ(a.random(), b.random());
    EXPECT_EQ(a.random2D(), b.random2D());
  }
}

TEST(Pcg32, IsUniformAndSeedsDiffer) {
  Pcg32 rng(1);
  std::vector<double> values;
  for (int i = 0; i < 100'000; ++i) values.push_back(static_cast<double>(rng.next()));
  EXPECT_GT(stats::kolmogorovSmirnov(values, [](double x) { return x; }), 1e-4);
  EXPECT_LT(stats::kolmogorovSmirnov(values, [](double x) { return std::pow(x, 1.05); }), 1e-4)
      << "the test cannot fail";
  EXPECT_NE(Pcg32(1).nextBits(), Pcg32(2).nextBits());
  Correlation seeds, successive;
  for (uint64_t seed = 0; seed < 20'000; ++seed) {
    Pcg32 a(seed), b(seed + 1);
    const float first = a.next();
    seeds.add(first, b.next()), successive.add(first, a.next());
  }
  EXPECT_TRUE(seeds.plausible()) << seeds.value();
  EXPECT_TRUE(successive.plausible()) << successive.value();
}

TEST(Pcg32, StaysBelowOne) {
  EXPECT_LT(toUnitFloat(0xffffffffu), 1.f);
  EXPECT_EQ(toUnitFloat(0), 0.f);
}

}  // namespace
}  // namespace virga
