// SPDX-License-Identifier: Apache-2.0
#include "core/distribution.h"

namespace virga {

Discrete::Discrete(std::span<const float> weights) : cdf_(weights.size() + 1, 0.f) {
  std::vector<double> sums(weights.size() + 1, 0.0);
  for (size_t i = 0; i < weights.size(); ++i) sums[i + 1] = sums[i] + static_cast<double>(weights[i]);
  total_ = sums.back();
  if (!(total_ > 0)) return;
  // The table ends at exactly 1 from the last item of positive weight on, so that u < 1 never lands behind it.
  for (size_t i = 0; i < sums.size(); ++i) cdf_[i] = sums[i] == total_ ? 1.f : static_cast<float>(sums[i] / total_);
}

}  // namespace virga
