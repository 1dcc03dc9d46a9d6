// SPDX-License-Identifier: Apache-2.0
#include "image/metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"

namespace virga {
namespace {

constexpr double kRounding = 1e-6;  // relative difference of two float means of the same value

void checkSameSize(const Image& a, const Image& b) {
  if (a.width == b.width && a.height == b.height) return;
  throw Error(
      fmt::format("the pictures differ in size: {} x {} and {} x {} pixels", a.width, a.height, b.width, b.height),
      {.position = {}, .hint = "render both with the same --size", .notes = {}});
}

struct Sums {
  double squared = 0, relativeSquared = 0, relative = 0, relativeSigned = 0, difference = 0, reference = 0;
  double peak = -std::numeric_limits<double>::infinity(), maxAbs = 0;
  int64_t pixels = 0, nonFinite = 0, referenceNonFinite = 0;
};

Sums sumsOf(Rgb image, Rgb reference) {
  Sums s;
  s.nonFinite = isFinite(image) ? 0 : 1;
  s.referenceNonFinite = isFinite(reference) ? 0 : 1;
  if (s.nonFinite + s.referenceNonFinite > 0) return s;
  s.pixels = 1;
  for (int c = 0; c < 3; ++c) {
    const double a = static_cast<double>(image[c]), b = static_cast<double>(reference[c]), d = a - b;
    s.squared += d * d;
    s.relativeSquared += d * d / (b * b + kRelativeFloor);
    s.relative += std::abs(d) / (std::abs(b) + kRelativeFloor);
    s.relativeSigned += d / (std::abs(b) + kRelativeFloor);
    s.difference += d;
    s.reference += b;
    s.peak = std::max(s.peak, b);
    s.maxAbs = std::max(s.maxAbs, std::abs(d));
  }
  return s;
}

Sums added(const Sums& a, const Sums& b) {
  return {.squared = a.squared + b.squared,
          .relativeSquared = a.relativeSquared + b.relativeSquared,
          .relative = a.relative + b.relative,
          .relativeSigned = a.relativeSigned + b.relativeSigned,
          .difference = a.difference + b.difference,
          .reference = a.reference + b.reference,
          .peak = std::max(a.peak, b.peak),
          .maxAbs = std::max(a.maxAbs, b.maxAbs),
          .pixels = a.pixels + b.pixels,
          .nonFinite = a.nonFinite + b.nonFinite,
          .referenceNonFinite = a.referenceNonFinite + b.referenceNonFinite};
}

double psnr(double peak, double mse) {
  if (mse == 0) return std::numeric_limits<double>::infinity();
  return 10 * std::log10(peak * peak / mse);
}

// Continued fraction of the incomplete beta function (Abramowitz and Stegun 26.5.8), evaluated from the front by
// Lentz's method: `c` and `d` are the ratios of successive numerators and denominators.
double betaFraction(double a, double b, double x) {
  constexpr double kTiny = 1e-300, kEnough = 1e-15;
  constexpr int kSteps = 1000;
  const auto nonZero = [](double v) { return std::abs(v) < kTiny ? kTiny : v; };
  double c = 1, d = 1 / nonZero(1 - (a + b) * x / (a + 1)), value = d;
  for (int m = 1; m <= kSteps; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    double factor = 1;
    for (const double term : {even, odd}) {
      d = 1 / nonZero(1 + term * d);
      c = nonZero(1 + term / c);
      factor = c * d;
      value *= factor;
    }
    if (std::abs(factor - 1) < kEnough) break;
  }
  return value;
}

// Regularised incomplete beta function I_x(a, b). The fraction converges fast below the mean; above it, by symmetry.
double incompleteBeta(double a, double b, double x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1) / (a + b + 2)) return front * betaFraction(a, b, x) / a;
  return 1 - front * betaFraction(b, a, 1 - x) / b;
}

// What testAgreement() gathers about the tests with one number of degrees of freedom. Rounding that number down makes a
// few bins of all tests, so that the tail of Student's law is evaluated once a bin and not once a pixel.
struct Bin {
  int64_t tests = 0, beyond2 = 0, beyond3 = 0;
  double chiSquared = 0, maxT = 0;
};

constexpr size_t kMaxDegrees =
    256;  // from here on Student's law passes for the normal one; rounding down is conservative

struct Bins {
  std::vector<Bin> bin;  ///< by degrees of freedom
  int64_t certain = 0, nonFinite = 0;
};

class Gatherer {
 public:
  Gatherer(int imageReplicates, int referenceReplicates) : dofA_(imageReplicates - 1), dofB_(referenceReplicates - 1) {
    bins_.bin.resize(std::min(kMaxDegrees, static_cast<size_t>(dofA_ + dofB_)) + 1);
  }

  void add(double a, double va, double b, double vb) {
    if (!std::isfinite(a) || !std::isfinite(b) || !std::isfinite(va) || !std::isfinite(vb)) {
      ++bins_.nonFinite;
      return;
    }
    const double rounding = kRounding * std::max(std::abs(a), std::abs(b));
    const double difference = a - b, variance = va + vb;
    if (variance <= 0) {
      bins_.certain += std::abs(difference) > rounding ? 1 : 0;
      return;
    }
    addTest(std::abs(difference) / std::sqrt(variance + rounding * rounding),
            variance * variance / (va * va / dofA_ + vb * vb / dofB_));
  }

  const Bins& bins() const { return bins_; }

 private:
  void addTest(double t, double degrees) {
    // The slack keeps an exact integer from being rounded to the one below it. NaN: variances that underflow when
    // squared.
    const double known = std::isfinite(degrees) ? degrees + 1e-9 : std::min(dofA_, dofB_);
    const size_t n = std::clamp(static_cast<size_t>(known), size_t{1}, bins_.bin.size() - 1);
    Bin& bin = bins_.bin[n];
    ++bin.tests;
    bin.beyond2 += t > 2 ? 1 : 0;
    bin.beyond3 += t > 3 ? 1 : 0;
    if (n > 2) bin.chiSquared += t * t * (known - 2) / known;
    bin.maxT = std::max(bin.maxT, t);
  }

  Bins bins_;
  double dofA_, dofB_;
};

void addInto(Bins& total, const Bins& part) {
  if (total.bin.empty()) total.bin.resize(part.bin.size());
  for (size_t n = 0; n < part.bin.size(); ++n) {
    Bin& t = total.bin[n];
    const Bin& p = part.bin[n];
    t.tests += p.tests, t.beyond2 += p.beyond2, t.beyond3 += p.beyond3;
    t.chiSquared += p.chiSquared;
    t.maxT = std::max(t.maxT, p.maxT);
  }
  total.certain += part.certain, total.nonFinite += part.nonFinite;
}

Agreement summary(const Bins& bins) {
  Agreement out;
  out.certain = bins.certain, out.nonFinite = bins.nonFinite;
  double chiSquared = 0, chiTests = 0, smallestP = 1;
  for (size_t n = 1; n < bins.bin.size(); ++n) {
    const Bin& bin = bins.bin[n];
    if (bin.tests == 0) continue;
    const double degrees = static_cast<double>(n), tests = static_cast<double>(bin.tests);
    out.tests += bin.tests;
    out.beyond2 += static_cast<double>(bin.beyond2), out.beyond3 += static_cast<double>(bin.beyond3);
    out.expectedBeyond2 += tests * studentTwoSided(2, degrees);
    out.expectedBeyond3 += tests * studentTwoSided(3, degrees);
    if (n > 2) chiSquared += bin.chiSquared, chiTests += tests;
    out.maximumT = std::max(out.maximumT, bin.maxT);
    smallestP = std::min(smallestP, studentTwoSided(bin.maxT, degrees));
  }
  if (out.tests == 0) return out;
  const double tests = static_cast<double>(out.tests);
  for (double* fraction : {&out.beyond2, &out.beyond3, &out.expectedBeyond2, &out.expectedBeyond3}) *fraction /= tests;
  out.chiSquaredPerDof = chiTests > 0 ? chiSquared / chiTests : std::numeric_limits<double>::quiet_NaN();
  out.maximumP = smallestP < 1 ? -std::expm1(tests * std::log1p(-smallestP)) : 1;  // 1 - (1 - p)^tests
  return out;
}

}  // namespace

Metrics compare(const Image& image, const Image& reference) {
  checkSameSize(image, reference);
  const Sums s = deterministicReduce<Sums>(
      static_cast<int64_t>(image.pixels.size()), {},
      [&](int64_t i) { return sumsOf(image.pixels[static_cast<size_t>(i)], reference.pixels[static_cast<size_t>(i)]); },
      added);
  if (s.pixels == 0) throw Error("the pictures have no pixel that is finite in both");
  const double values = 3 * static_cast<double>(s.pixels);
  return {.mse = s.squared / values,
          .relMse = s.relativeSquared / values,
          .mape = s.relative / values,
          .psnr = psnr(s.peak, s.squared / values),
          .bias = s.relativeSigned / values,
          .excess = s.difference == 0 ? 0 : s.difference / s.reference,
          .maxAbs = s.maxAbs,
          .pixels = s.pixels,
          .nonFinite = s.nonFinite,
          .referenceNonFinite = s.referenceNonFinite};
}

double studentTwoSided(double t, double n) {
  if (std::isnan(t)) return t;
  if (std::isinf(t)) return 0;
  return incompleteBeta(n / 2, 0.5, n / (n + t * t));
}

Agreement testAgreement(const Image& image, const Uncertainty& imageNoise, const Image& reference,
                        const Uncertainty& referenceNoise) {
  VIRGA_ASSERT(imageNoise.replicates >= 2 && referenceNoise.replicates >= 2);
  checkSameSize(image, reference);
  checkSameSize(image, imageNoise.variance);
  checkSameSize(image, referenceNoise.variance);
  std::vector<Bins> rows(static_cast<size_t>(image.height));
  parallelFor(image.height, 16, [&](int64_t y) {
    Gatherer row(imageNoise.replicates, referenceNoise.replicates);
    for (int x = 0; x < image.width; ++x) {
      const int line = static_cast<int>(y);
      const Rgb a = image.at(x, line), va = imageNoise.variance.at(x, line);
      const Rgb b = reference.at(x, line), vb = referenceNoise.variance.at(x, line);
      for (int c = 0; c < 3; ++c)
        row.add(static_cast<double>(a[c]), static_cast<double>(va[c]), static_cast<double>(b[c]),
                static_cast<double>(vb[c]));
    }
    rows[static_cast<size_t>(y)] = row.bins();
  });
  Bins total;
  for (const Bins& row : rows) addInto(total, row);
  return summary(total);
}

Image signedDifference(const Image& image, const Image& reference, const SignedDifference& options) {
  checkSameSize(image, reference);
  Image out(image.width, image.height);
  parallelFor(static_cast<int64_t>(out.pixels.size()), 4096, [&](int64_t i) {
    const size_t pixel = static_cast<size_t>(i);
    const Rgb a = image.pixels[pixel], b = reference.pixels[pixel];
    const float difference = isFinite(a) && isFinite(b) ? options.gain * mean(a - b) : std::nanf("");
    const auto positive = [](float x) { return x < 0 ? 0 : x; };  // keeps NaN
    out.pixels[pixel] = {positive(difference), positive(-difference), 0};
  });
  return out;
}

}  // namespace virga
