// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <vector>

#include "core/sampler.h"
#include "image/image.h"
#include "scene/scene.h"

namespace virga {

/// An estimate with its 95 % confidence interval. The estimate is unbiased, not clamped: relMSE may come out below 0.
struct Estimated {
  double value = 0, low = 0, high = 0;
};

/// How wrong a picture is, as far as an audit can tell. Bias and relMSE are those of image/metrics.h.
struct AuditResult {
  Estimated bias;    ///< mean signed relative difference
  Estimated relMse;  ///< of noise and bias together
  /// What correcting the denominators took from relMse.value. The bias that is left in it is a fraction of this.
  double correction = 0;
  int64_t pixels = 0;     ///< looked at; one that was drawn twice counts twice
  int64_t samples = 0;    ///< of the truth, in each of them
  int64_t nonFinite = 0;  ///< of these pixels, left out: the picture or a sample of the truth is NaN or infinite
  double seconds = 0;

  /// The audit was so short that the bias left in relMse may be a quarter of the interval or more.
  bool tooShort() const;
};

/// Holds a picture against independent samples of the truth in a few of its pixels (docs/audit.md).
///
/// The pixels of a *panel* are a stratified random set; panels are independent of each other, and the interval comes
/// from between their means, so that it counts the choice of pixels and the noise of the truth alike. In each pixel
/// there are four independent *groups* of samples. Products of two groups estimate the squared error in spite of their
/// noise, E (a - p1)(a - p2) = (a - b)^2; the denominator comes from the other two, corrected by the jackknife.
class Audit {
 public:
  static constexpr int kPanels = 32;
  static constexpr int kGroups = 4;

  /// A sample of the truth in a pixel of the picture. Called from many threads.
  using Truth = std::function<Rgb(int x, int y, const SampleId&)>;

  /// The picture must outlive it. At least one pixel in each panel.
  Audit(const Image& picture, Truth truth, uint64_t seed, int pixelsInPanel);

  /// One more sample in each group of each pixel. A round that `stop` meets does not count; then it is false.
  bool round(std::stop_token stop = {});
  int64_t rounds() const { return rounds_; }
  /// Nothing before the first round, and where fewer than two panels have a finite pixel.
  std::optional<AuditResult> result() const;

  /// What a pixel or a panel says.
  struct Terms {
    double bias = 0, relMse = 0;
    double uncorrected = 0;  ///< relMse without the jackknife

    Terms& operator+=(const Terms& t) {
      bias += t.bias, relMse += t.relMse, uncorrected += t.uncorrected;
      return *this;
    }
    Terms operator*(double s) const { return {bias * s, relMse * s, uncorrected * s}; }
  };

 private:
  struct Sum {
    std::array<double, 3> value{};
  };
  struct Pixel {
    int x = 0, y = 0;
    std::array<Sum, kGroups> groups{};
  };

  Terms pixelTerms(size_t pixel) const;

  const Image& picture_;
  Truth truth_;
  uint64_t seed_;
  int pixelsInPanel_;
  std::vector<Pixel> pixels_;  ///< panel by panel
  int64_t rounds_ = 0;
};

/// `path` with the scene's own depth. The scene must outlive it.
Audit::Truth pathTruth(const Scene&);

struct AuditBudget {
  double seconds = 0;
  uint64_t seed = 0;  ///< the picture's; the audit draws numbers that are independent of it
};

/// Spends the time on samples of `path`: one round at least. First rounds are added up to
/// 256, then more pixels are taken instead. `picture` is one of the scene, of the same size. A stop ends it early;
/// nothing if there is no result then.
std::optional<AuditResult> auditPicture(const Scene&, const Image& picture, const AuditBudget&, std::stop_token = {});

}  // namespace virga
