// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

namespace virga {

/// Counts values that no extinction, albedo or temperature may have, and remembers the first by (z, y, x).
struct ValueCheck {
  uint64_t nan = 0, infinite = 0, negative = 0;
  std::array<int64_t, 3> first{};  ///< x, y, z
  float maximum = 0;               ///< of the good values

  bool good() const { return nan + infinite + negative == 0; }
  void add(float value, std::array<int64_t, 3> where, uint64_t times = 1) {
    if (value >= 0 && value <= std::numeric_limits<float>::max())
      maximum = std::max(maximum, value);
    else
      addBad(value, where, times);
  }
  /// Throws Error unless all was good: how many of each kind there are and where the first is.
  void require() const;

 private:
  void addBad(float value, std::array<int64_t, 3> where, uint64_t times);
};

/// Both together; needs no order.
ValueCheck combined(const ValueCheck& a, const ValueCheck& b);

}  // namespace virga
