// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/vec.h"

/// Tests of random routines. A p-value is the probability to see so large a deviation, or a larger one, if the claim is
/// true: a test that asks for p > 1e-4 cries wolf once in ten thousand seeds, and never for a seed that has passed
/// before. Each such test wants a negative control: a claim that is slightly wrong and must get a small p-value.
namespace virga::stats {

// --- Goodness of fit ---

/// Cells of the unit sphere: rings about `axis`, each cut into `phi` equal sectors. The rings are chosen so that each
/// holds about the same share of the density, however peaked it is about the axis; the equator is a border of rings
/// whenever the density ends there.
struct SphereTest {
  int theta = 16;
  int phi = 32;
  Vec3 axis{0, 0, 1};
  int64_t samples = 200'000;
  uint64_t seed = 1;
};

/// Chi-squared test of directions against a density [1/sr], on the cells and on the sums over rings, sectors and all;
/// returns the p-value (of the worst of the four, so rather too large than too small). `sample` gets uniform numbers in
/// the unit square; it may return nothing for a sample that is lost, and then the density must integrate to less than 1
/// by just as much. A density that integrates to more than 1.002, and samples where the density is 0 throughout a cell,
/// give 0. The density may jump; a peak away from the axis must be wider than about 0.02 rad to be found.
double chiSquared(const SphereTest& test, const std::function<std::optional<Vec3>(Vec2)>& sample,
                  const std::function<double(Vec3)>& density);

/// Intervals of [lo, hi], chosen to hold about the same share of the density. Samples outside count as lost.
struct IntervalTest {
  int cells = 64;
  double lo = 0, hi = 1;
  int64_t samples = 200'000;
  uint64_t seed = 1;
};

/// As above, for numbers and their density over the line. What the density has outside [lo, hi] goes to the lost
/// samples.
double chiSquaredInterval(const IntervalTest& test, const std::function<std::optional<double>(float)>& sample,
                          const std::function<double(double)>& density);

/// nx x ny equal cells of the unit square. Samples outside count as lost.
struct SquareTest {
  int nx = 16, ny = 16;
  int64_t samples = 200'000;
  uint64_t seed = 1;
};

/// As above, for points and their density over the plane.
double chiSquaredSquare(const SquareTest& test, const std::function<std::optional<Vec2>(Vec2)>& sample,
                        const std::function<double(Vec2)>& density);

/// p-value of Pearson's statistic for counts whose total is given. Cells that expect fewer than 10 are pooled, smallest
/// first; more than 1e-5 of the total in cells that expect nothing give 0.
double chiSquaredCounts(std::span<const double> observed, std::span<const double> expected);

/// p-value of the Kolmogorov-Smirnov test that `values` were drawn independently from the continuous distribution
/// function `cdf` (asymptotic; some 50 values at least).
double kolmogorovSmirnov(std::vector<double> values, const std::function<double(double)>& cdf);

// --- Integrals ---

/// Integral over the unit sphere [unit of f times sr], adaptive; a peak should lie on `axis` unless it is wider than
/// 0.02 rad. The error is about `tolerance`, and no better than what f can tell of single-precision directions.
double integrateSphere(const std::function<double(Vec3)>& f, Vec3 axis = {0, 0, 1}, double tolerance = 1e-5);

/// Integral over [lo, hi], adaptive, error about `tolerance`.
double integrateInterval(const std::function<double(double)>& f, double lo, double hi, double tolerance = 1e-8);

// --- Means ---

/// Running count, mean and variance (Welford 1962).
class Moments {
 public:
  Moments() = default;
  explicit Moments(std::span<const double> values);

  void add(double value);
  int64_t count() const { return count_; }
  double mean() const { return mean_; }
  double variance() const;       ///< unbiased, of one value; 0 below two values
  double standardError() const;  ///< of the mean

 private:
  int64_t count_ = 0;
  double mean_ = 0, squares_ = 0;
};

/// Two-sided p-values. The t-tests assume independent, nearly normal values (averages of many samples: replicates);
/// where nothing varies, they compare for equality.
double welchTest(const Moments& a, const Moments& b);          ///< that both have the same mean; variances may differ
double oneSampleTest(const Moments& values, double expected);  ///< that the mean is `expected`
double zTest(double value, double expected, double standardError);

/// Median of the means of `groups` consecutive groups of nearly equal size: an estimate of the mean that outliers of a
/// heavy tail hardly move.
double medianOfMeans(std::span<const double> values, int groups);

struct LineFit {
  double intercept, slope;
  double slopeError;  ///< standard error, from the residuals; 0 below three points
};

/// Least squares y = intercept + slope x; at least two different x. For a rate of convergence fit logarithms.
LineFit fitLine(std::span<const double> x, std::span<const double> y);

// --- Distribution functions ---

double gammaUpper(double a, double x);  ///< regularised upper incomplete gamma function Q(a, x); a > 0, x >= 0
double betaRegularised(double a, double b, double x);  ///< regularised incomplete beta function I_x(a, b); a, b > 0
double chiSquaredTail(double statistic, double degreesOfFreedom);  ///< P(larger)
double studentCdf(double t, double degreesOfFreedom);
double normalCdf(double z);
double kolmogorovTail(double lambda);  ///< P(sqrt(n) D > lambda) for n -> infinity

}  // namespace virga::stats
