// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/vec.h"

namespace virga {

/// Distances in [0, d] in proportion to exp(-s t), with s the local mean of sigma_t: the paper's restricted free
/// flight. Half of them are drawn uniformly instead, and both densities are weighed together: where s is far above the
/// true extinction the weights would else grow as exp(s t).
struct RestrictedDistance {
  float s;  ///< [1/unit], >= 0
  float d;  ///< [unit], > 0

  /// u.y chooses between the two.
  VIRGA_HD float sample(Vec2 u) const {
    if (u.y < 0.5f || !(s * d > 1e-6f)) return u.x * d;
    return std::fmin(d, -std::log1p(u.x * std::expm1(-s * d)) / s);
  }
  /// [1/unit], for t in [0, d].
  VIRGA_HD float pdf(float t) const {
    if (!(s * d > 1e-6f)) return 1 / d;
    return 0.5f / d - 0.5f * s * std::exp(-s * t) / std::expm1(-s * d);
  }
  /// Probability of a distance above t in [0, d].
  VIRGA_HD float beyond(float t) const {
    const float uniform = 1 - t / d;
    if (!(s * d > 1e-6f)) return uniform;
    return 0.5f * uniform + 0.5f * std::exp(-s * t) * std::expm1(-s * (d - t)) / std::expm1(-s * d);
  }
};

}  // namespace virga
