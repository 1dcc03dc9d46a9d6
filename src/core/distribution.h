// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/host_device.h"
#include "core/vec.h"

namespace virga {

/// Discrete distribution over n items, as a view of its cumulative table (n + 1 values from 0 to 1).
struct DiscreteView {
  const float* cdf = nullptr;
  int count = 0;

  struct Sample {
    int index;
    float probability;
    float remapped;  ///< the random number, stretched to [0, 1) within the chosen item
  };

  VIRGA_HD float probability(int i) const { return cdf[i + 1] - cdf[i]; }
  VIRGA_HD Sample sample(float u) const {
    int lo = 0, hi = count;  // cdf[lo] <= u < cdf[hi]
    while (hi - lo > 1) {
      const int middle = (lo + hi) / 2;
      (cdf[middle] <= u ? lo : hi) = middle;
    }
    const float p = probability(lo);
    return {lo, p, p > 0 ? std::min((u - cdf[lo]) / p, 0x1.fffffep-1f) : 0};
  }
};

/// Owner of a DiscreteView. Items of weight 0 are never sampled.
class Discrete {
 public:
  Discrete() = default;
  /// `weights` >= 0; where all are 0 the distribution is empty (total() == 0) and must not be sampled.
  explicit Discrete(std::span<const float> weights);
  DiscreteView view() const { return {cdf_.data(), static_cast<int>(cdf_.size()) - 1}; }
  double total() const { return total_; }

 private:
  std::vector<float> cdf_ = {0.f};
  double total_ = 0;
};

}  // namespace virga
