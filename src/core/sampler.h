// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/random.h"
#include "core/vec.h"

namespace virga {

VIRGA_HD constexpr uint32_t reverseBits(uint32_t x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
  return (x >> 16) | (x << 16);
}

/// Owen scrambling (nested uniform) of a binary fraction, by a hash in which every bit depends on higher bits only
/// (Laine and Karras 2011; constants of N. Vegdahl).
VIRGA_HD constexpr uint32_t owenScramble(uint32_t fraction, uint32_t seed) {
  uint32_t x = reverseBits(fraction);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reverseBits(x);
}

/// Second dimension of Sobol's sequence (primitive polynomial x + 1): its generator matrix is Pascal's triangle modulo 2.
VIRGA_HD constexpr uint32_t sobolSecond(uint32_t index) {
  uint32_t result = 0;
  for (uint32_t column = 0x80000000u; index != 0; index >>= 1, column ^= column >> 1)
    if (index & 1u) result ^= column;
  return result;
}

/// Names one sample: everything random in it is a function of these numbers and of the order in which it is asked for.
struct SampleId {
  uint64_t seed;       ///< the render's
  uint32_t replicate;  ///< independently scrambled sequences
  uint32_t stream;     ///< pixel or walk
  uint32_t index;      ///< of the sample within (replicate, stream): position in the low-discrepancy sequence
};

/// Random numbers of one sample. next1D and next2D come from Owen-scrambled Sobol points, two dimensions at a time, each pair
/// with an order and a scramble of its own ("padding": no bad projections, however many dimensions are used). random() is an
/// independent stream for what has no fixed dimension (tracking, deep bounces).
class Sampler {
 public:
  VIRGA_HD explicit Sampler(const SampleId& id)
      : index_(id.index),
        scramble_(hashCombine(static_cast<uint32_t>(hash64(id.seed * kReplicateStride + id.replicate)), id.stream)),
        rng_((static_cast<uint64_t>(scramble_) << 32) ^ hash64(id.seed ^ (static_cast<uint64_t>(id.stream) << 32)) ^ id.index) {}

  VIRGA_HD Vec2 next2D() {
    const uint32_t pair = hashCombine(scramble_, ++pair_);
    const uint32_t shuffled = shuffledIndex(pair);
    const uint32_t x = owenScramble(reverseBits(shuffled), hash32(pair ^ 0x02e5be93u));
    const uint32_t y = owenScramble(sobolSecond(shuffled), hash32(pair ^ 0x967a889bu));
    return {toUnitFloat(x), toUnitFloat(y)};
  }
  VIRGA_HD float next1D() {
    const uint32_t pair = hashCombine(scramble_, ++pair_);
    return toUnitFloat(owenScramble(reverseBits(shuffledIndex(pair)), hash32(pair ^ 0x02e5be93u)));
  }
  VIRGA_HD float random() { return rng_.next(); }
  VIRGA_HD Vec2 random2D() {
    const float x = rng_.next();
    return {x, rng_.next()};
  }
  VIRGA_HD Pcg32& stream() { return rng_; }

 private:
  // A bit of the result depends on higher bits of the index only, so an aligned block of indices becomes another aligned
  // block and stays a (0,2)-net. (Were it the lower bits, the second coordinate would lose its strata.)
  VIRGA_HD uint32_t shuffledIndex(uint32_t pair) const { return owenScramble(index_, hash32(pair ^ 0x68bc21ebu)); }

  static constexpr uint64_t kReplicateStride = 0x9e3779b97f4a7c15ull;
  uint32_t index_, scramble_, pair_ = 0;
  Pcg32 rng_;
};

}  // namespace virga
