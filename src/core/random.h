// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/host_device.h"

namespace virga {

/// A bijection on 32 bits that scatters well (the "lowbias32" constants found by search, C. Wellons).
VIRGA_HD constexpr uint32_t hash32(uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

VIRGA_HD constexpr uint32_t hashCombine(uint32_t seed, uint32_t value) {
  return hash32(seed ^ (hash32(value) + 0x9e3779b9u));
}

/// splitmix64's finaliser: 64 bits to 64 bits.
VIRGA_HD constexpr uint64_t hash64(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

/// In [0, 1): the 24 highest bits, so that 1 is never reached.
VIRGA_HD constexpr float toUnitFloat(uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

/// PCG-XSH-RR 64/32 (O'Neill 2014): a small, fast stream of independent numbers.
class Pcg32 {
 public:
  VIRGA_HD explicit constexpr Pcg32(uint64_t seed = 0) : state_(hash64(seed)) {}

  VIRGA_HD constexpr uint32_t nextBits() {
    const uint64_t old = state_;
    state_ = old * 6364136223846793005ull + 1442695040888963407ull;
    const auto xorShifted = static_cast<uint32_t>(((old >> 18) ^ old) >> 27);
    const auto rotation = static_cast<uint32_t>(old >> 59);
    return (xorShifted >> rotation) | (xorShifted << ((32 - rotation) & 31));
  }
  VIRGA_HD constexpr float next() { return toUnitFloat(nextBits()); }

 private:
  uint64_t state_;
};

}  // namespace virga
