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

/// A hash in which every bit depends on lower bits only (Laine and Karras 2011; constants of N. Vegdahl): Owen
/// scrambling of a binary fraction whose bits stand in reverse.
VIRGA_HD constexpr uint32_t scrambleReversed(uint32_t x, uint32_t seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

/// Owen scrambling (nested uniform) of a binary fraction.
VIRGA_HD constexpr uint32_t owenScramble(uint32_t fraction, uint32_t seed) {
  return reverseBits(scrambleReversed(reverseBits(fraction), seed));
}

/// Second dimension of Sobol's sequence (primitive polynomial x + 1), its bits in reverse. The generator matrix is
/// Pascal's triangle modulo 2, and a binomial coefficient (i over j) is odd where the bits of j are a subset of those
/// of i (Lucas): so the product is a sum over supersets, bit by bit of the bits' numbers.
VIRGA_HD constexpr uint32_t sobolSecondReversed(uint32_t index) {
  index ^= (index >> 1) & 0x55555555u;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 4) & 0x0f0f0f0fu;
  index ^= (index >> 8) & 0x00ff00ffu;
  index ^= (index >> 16) & 0x0000ffffu;
  return index;
}
VIRGA_HD constexpr uint32_t sobolSecond(uint32_t index) { return reverseBits(sobolSecondReversed(index)); }

/// Names one sample: everything random in it is a function of these numbers and of the order in which it is asked for.
struct SampleId {
  uint64_t seed;       ///< the render's
  uint32_t replicate;  ///< independently scrambled sequences
  uint32_t stream;     ///< pixel or walk
  uint32_t index;      ///< of the sample within (replicate, stream): position in the low-discrepancy sequence
};

/// Random numbers of one sample. next1D and next2D come from Owen-scrambled Sobol points, two dimensions at a time,
/// each pair with an order and a scramble of its own ("padding": no bad projections, however many dimensions are used).
/// random() is an independent stream for what has no fixed dimension (tracking, deep bounces).
class Sampler {
 public:
  VIRGA_HD explicit Sampler(const SampleId& id)
      : reversedIndex_(reverseBits(id.index)),
        stream_(hash64(hash64(id.seed * kReplicateStride + id.replicate) + id.stream)),
        rng_(stream_ ^ id.index) {}

  VIRGA_HD Vec2 next2D() {
    const Pair p = nextPair();
    const uint32_t x = scrambleReversed(p.index, p.seedX);
    const uint32_t y = scrambleReversed(sobolSecondReversed(p.index), p.seedY);
    return {toUnitFloat(reverseBits(x)), toUnitFloat(reverseBits(y))};
  }
  VIRGA_HD float next1D() {
    const Pair p = nextPair();
    return toUnitFloat(reverseBits(scrambleReversed(p.index, p.seedX)));
  }
  VIRGA_HD float random() { return rng_.next(); }
  VIRGA_HD Vec2 random2D() {
    const float x = rng_.next();
    return {x, rng_.next()};
  }
  VIRGA_HD Pcg32& stream() { return rng_; }

 private:
  /// One pair of dimensions: where in the sequence this sample stands, and its scrambles.
  struct Pair {
    uint32_t index, seedX, seedY;
  };
  // In the shuffled index a bit depends on higher bits only, so that an aligned block of indices becomes another
  // aligned block and stays a (0,2)-net. (Were it the lower bits, the second coordinate would lose its strata.)
  VIRGA_HD Pair nextPair() {
    const uint64_t h = hash64(stream_ + ++pair_ * kReplicateStride);
    const auto low = static_cast<uint32_t>(h), high = static_cast<uint32_t>(h >> 32);
    return {reverseBits(scrambleReversed(reversedIndex_, low)), high, hash32(low ^ high)};
  }

  static constexpr uint64_t kReplicateStride = 0x9e3779b97f4a7c15ull;
  uint32_t reversedIndex_;
  uint32_t pair_ = 0;
  uint64_t stream_;
  Pcg32 rng_;
};

}  // namespace virga
