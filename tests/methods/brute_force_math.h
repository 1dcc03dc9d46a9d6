// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "methods/brute_force.h"

/// What the parts of the brute-force tracer share.
namespace virga::testing::brute {

inline constexpr double kNever = std::numeric_limits<double>::infinity();
inline constexpr double kPiExact = std::numbers::pi;

inline double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector cross(Vector a, Vector b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vector unit(Vector a) { return a * (1 / std::sqrt(dot(a, a))); }
inline bool black(Vector a) { return a == Vector{}; }

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  double operator()() { return std::uniform_real_distribution<double>()(engine_); }

 private:
  std::mt19937_64 engine_;
};

struct Line {
  Vector o, d;
  Vector at(double t) const { return o + d * t; }
};

/// Unit vector at an angle to the axis, of any azimuth.
inline Vector around(Vector axis, double cosine, Random& random) {
  const Vector helper = std::fabs(axis.x) < 0.5 ? Vector{1, 0, 0} : Vector{0, 1, 0};
  const Vector s = unit(cross(axis, helper)), t = cross(axis, s);
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine)), phi = 2 * kPiExact * random();
  return axis * cosine + s * (sine * std::cos(phi)) + t * (sine * std::sin(phi));
}

}  // namespace virga::testing::brute
