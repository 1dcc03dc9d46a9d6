// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/vec.h"

namespace virga {

/// A well mixed 32-bit number for each lattice point and seed.
inline uint32_t latticeHash(int x, int y, int z, uint32_t seed) {
  uint32_t h = seed * 0x9e3779b9u + 0x7f4a7c15u;
  for (int v : {x, y, z}) {
    h ^= static_cast<uint32_t>(v);
    h *= 0x85ebca6bu;
    h ^= h >> 15;
  }
  h *= 0xc2b2ae35u;
  return h ^ (h >> 16);
}

/// Uniform in [0, 1).
inline float toUnit(uint32_t h) { return static_cast<float>(h >> 8) * 0x1p-24f; }

/// Three independent uniform numbers in [0, 1) from one hash.
inline Vec3 toUnit3(uint32_t h) {
  return {static_cast<float>(h & 1023) / 1024, static_cast<float>(h >> 10 & 1023) / 1024,
          static_cast<float>(h >> 20 & 1023) / 1024};
}

inline float smoothstep(float lo, float hi, float x) {
  const float t = clamp((x - lo) / (hi - lo), 0, 1);
  return t * t * (3 - 2 * t);
}

/// Gradient noise on the integer lattice, about [-1, 1]; repeats after `period` (a power of two) along each axis.
inline float gradientNoise(Vec3 p, uint32_t seed, int period = 1 << 30) {
  const Vec3 base{std::floor(p.x), std::floor(p.y), std::floor(p.z)}, f = p - base;
  const int i = static_cast<int>(base.x), j = static_cast<int>(base.y), k = static_cast<int>(base.z), mask = period - 1;
  const auto corner = [&](int di, int dj, int dk) {
    const Vec3 g = toUnit3(latticeHash((i + di) & mask, (j + dj) & mask, (k + dk) & mask, seed)) * 2.f - Vec3(1);
    return dot(g, f - Vec3(static_cast<float>(di), static_cast<float>(dj), static_cast<float>(dk)));
  };
  const auto fade = [](float t) { return t * t * t * (t * (t * 6 - 15) + 10); };
  const float u = fade(f.x), v = fade(f.y), w = fade(f.z);
  const float c00 = lerp(corner(0, 0, 0), corner(1, 0, 0), u), c10 = lerp(corner(0, 1, 0), corner(1, 1, 0), u);
  const float c01 = lerp(corner(0, 0, 1), corner(1, 0, 1), u), c11 = lerp(corner(0, 1, 1), corner(1, 1, 1), u);
  return lerp(lerp(c00, c10, v), lerp(c01, c11, v), w);
}

/// Octaves of gradient noise, each of twice the frequency and half the weight; about [-1, 1].
inline float fractalNoise(Vec3 p, uint32_t seed, int octaves) {
  float sum = 0, weight = 1;
  for (int n = 0; n < octaves; ++n, weight *= 0.5f, p = p * 2.03f + Vec3(17.1f, 5.7f, 31.3f))
    sum += weight * gradientNoise(p, seed + static_cast<uint32_t>(n));
  return sum;
}

/// Distance to the nearest of the points that are strewn one to each lattice cell; about [0, 1].
inline float cellNoise(Vec3 p, uint32_t seed) {
  const Vec3 base{std::floor(p.x), std::floor(p.y), std::floor(p.z)}, f = p - base;
  const int i = static_cast<int>(base.x), j = static_cast<int>(base.y), k = static_cast<int>(base.z);
  float nearest = 3;
  for (int dk = -1; dk <= 1; ++dk)
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di) {
        const Vec3 cell(static_cast<float>(di), static_cast<float>(dj), static_cast<float>(dk));
        const Vec3 d = cell + toUnit3(latticeHash(i + di, j + dj, k + dk, seed)) - f;
        nearest = std::min(nearest, lengthSquared(d));
      }
  return std::sqrt(nearest);
}

}  // namespace virga
