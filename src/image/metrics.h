// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "image/image.h"

namespace virga {

/// Keeps relative errors of black pixels finite; the papers' value.
inline constexpr double kRelativeFloor = 0.01;

/// How far a picture a is from its reference b. All means run over pixels and channels, in double; pixels that are not
/// finite in a or in b are left out and counted. The result does not depend on the number of threads.
struct Metrics {
  double mse = 0;         ///< mean (a - b)^2
  double relMse = 0;      ///< mean (a - b)^2 / (b^2 + 0.01)
  double mape = 0;        ///< mean |a - b| / (|b| + 0.01): a fraction, not percent
  double psnr = 0;        ///< 10 log10(peak^2 / mse) [dB], peak the largest finite value of b; infinite where mse is 0
  double bias = 0;        ///< mean signed relative difference, mean (a - b) / (|b| + 0.01): every pixel counts alike
  double excess = 0;      ///< sum (a - b) / sum b: bright pixels count more; no small number below it. 0 / 0 is 0
  double maxAbs = 0;      ///< max |a - b|
  int64_t pixels = 0;     ///< compared
  int64_t nonFinite = 0;  ///< pixels of a that are not finite
  int64_t referenceNonFinite = 0;  ///< pixels of b that are not finite
};

/// Throws Error if the sizes differ or no pixel is finite in both.
Metrics compare(const Image& image, const Image& reference);

/// A picture's own variance: of the mean of `replicates` independent ones.
struct Uncertainty {
  const Image& variance;
  int replicates = 8;  ///< at least 2
};

/// Do two pictures agree within their noise? Per pixel and channel, Welch's t = (a - b) / sqrt(va + vb), with
/// (va + vb)^2 / (va^2 / (ra - 1) + vb^2 / (rb - 1)) degrees of freedom, rounded down for p-values. Under "both have
/// the same expectation, replicates are normal" the expected values below hold.
///
/// Replicates of few samples are skewed, not normal: then the tails are heavier, and a small maximumP says less than an
/// excess of chiSquaredPerDof over many pixels. Channels of a pixel, and pixels that share light paths, correlate:
/// Sidak's correction then errs on the side of agreement.
struct Agreement {
  int64_t tests = 0;   ///< values with a variance; the others are equal, or in `certain`
  double beyond2 = 0;  ///< fraction of |t| > 2
  double beyond3 = 0;  ///< fraction of |t| > 3
  double expectedBeyond2 =
      0;  ///< what to expect of beyond2: more than the normal law's 4.55 %, as variances are estimates
  double expectedBeyond3 = 0;  ///< likewise
  /// Mean of t^2 (n - 2) / n, n the degrees of freedom, over the tests with n of 3 or more. Expected 1, or up to 3 %
  /// below: n is an estimate itself. NaN without such tests.
  double chiSquaredPerDof = 0;
  double maximumT = 0;    ///< largest |t|
  double maximumP = 1;    ///< p-value of the most unlikely t among all tests (Sidak)
  int64_t certain = 0;    ///< values without variance on either side that differ
  int64_t nonFinite = 0;  ///< values left out: a, b or a variance is not finite
};

/// Differences below 1e-6 of the value count as none: two means of one value differ by rounding. Throws Error if the
/// sizes differ.
Agreement testAgreement(const Image& image, const Uncertainty& imageNoise, const Image& reference,
                        const Uncertainty& referenceNoise);

/// P(|T| > |t|) of Student's t with n > 0 degrees of freedom.
double studentTwoSided(double t, double n);

struct SignedDifference {
  float gain = 2;
};

/// The signed picture of the papers, linear: black where the mean of the channels agrees, green where `image` is too
/// dark, red where it is too bright, gain |a - b| strong. NaN where either is not finite (magenta once tone mapped).
/// Throws Error if the sizes differ.
Image signedDifference(const Image& image, const Image& reference, const SignedDifference& options = {});

}  // namespace virga
