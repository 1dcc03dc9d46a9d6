// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/host_device.h"

namespace virga {

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kTwoPi = 2 * kPi;
inline constexpr float kInvPi = 1 / kPi;
inline constexpr float kInv4Pi = 0.25f / kPi;
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Vec2 {
  float x = 0, y = 0;

  friend VIRGA_HD constexpr Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
  friend VIRGA_HD constexpr Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
  friend VIRGA_HD constexpr Vec2 operator*(Vec2 a, float s) { return {a.x * s, a.y * s}; }
  friend VIRGA_HD constexpr Vec2 operator*(float s, Vec2 a) { return a * s; }
  friend constexpr bool operator==(Vec2, Vec2) = default;
};

/// A point, direction or normal; the transform that is applied tells them apart.
struct Vec3 {
  float x = 0, y = 0, z = 0;

  constexpr Vec3() = default;
  VIRGA_HD constexpr Vec3(float x_, float y_, float z_) : x(x_), y(y_), z(z_) {}
  VIRGA_HD explicit constexpr Vec3(float s) : x(s), y(s), z(s) {}

  VIRGA_HD constexpr float operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }
  VIRGA_HD constexpr float& operator[](int i) { return i == 0 ? x : (i == 1 ? y : z); }

  friend VIRGA_HD constexpr Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
  friend VIRGA_HD constexpr Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend VIRGA_HD constexpr Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend VIRGA_HD constexpr Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend VIRGA_HD constexpr Vec3 operator/(Vec3 a, Vec3 b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }
  friend VIRGA_HD constexpr Vec3 operator*(Vec3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
  friend VIRGA_HD constexpr Vec3 operator*(float s, Vec3 a) { return a * s; }
  friend VIRGA_HD constexpr Vec3 operator/(Vec3 a, float s) { return a * (1 / s); }
  VIRGA_HD constexpr Vec3& operator+=(Vec3 b) { return *this = *this + b; }
  VIRGA_HD constexpr Vec3& operator-=(Vec3 b) { return *this = *this - b; }
  VIRGA_HD constexpr Vec3& operator*=(float s) { return *this = *this * s; }
  friend constexpr bool operator==(Vec3, Vec3) = default;
};

VIRGA_HD constexpr float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
VIRGA_HD constexpr Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
VIRGA_HD constexpr float lengthSquared(Vec3 a) { return dot(a, a); }
VIRGA_HD inline float length(Vec3 a) { return std::sqrt(dot(a, a)); }
VIRGA_HD inline Vec3 normalize(Vec3 a) { return a / length(a); }
VIRGA_HD inline float distance(Vec3 a, Vec3 b) { return length(a - b); }
VIRGA_HD constexpr Vec3 min(Vec3 a, Vec3 b) {
  return {a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z};
}
VIRGA_HD constexpr Vec3 max(Vec3 a, Vec3 b) {
  return {a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z};
}
VIRGA_HD constexpr float maxComponent(Vec3 a) { return std::max(a.x, std::max(a.y, a.z)); }
VIRGA_HD constexpr float minComponent(Vec3 a) { return std::min(a.x, std::min(a.y, a.z)); }
VIRGA_HD inline Vec3 abs(Vec3 a) { return {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)}; }
VIRGA_HD inline bool isFinite(Vec3 a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

VIRGA_HD constexpr float lerp(float a, float b, float t) { return a + (b - a) * t; }
VIRGA_HD constexpr float square(float x) { return x * x; }
VIRGA_HD constexpr float clamp(float x, float lo, float hi) { return x < lo ? lo : (x > hi ? hi : x); }

/// Half-line o + t d for t in [0, inf); d is unit unless a function says otherwise.
struct Ray {
  Vec3 o, d;
  VIRGA_HD constexpr Vec3 at(float t) const { return o + d * t; }
};

/// Axis-aligned box; empty until it is extended.
struct Bounds {
  Vec3 lo{kInfinity, kInfinity, kInfinity};
  Vec3 hi{-kInfinity, -kInfinity, -kInfinity};

  void extend(Vec3 p) { lo = min(lo, p), hi = max(hi, p); }
  void extend(const Bounds& b) { lo = min(lo, b.lo), hi = max(hi, b.hi); }
  bool empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
  VIRGA_HD Vec3 center() const { return (lo + hi) * 0.5f; }
  VIRGA_HD Vec3 extent() const { return hi - lo; }
  Vec3 corner(int i) const { return {(i & 1) ? hi.x : lo.x, (i & 2) ? hi.y : lo.y, (i & 4) ? hi.z : lo.z}; }
  friend bool operator==(const Bounds&, const Bounds&) = default;
};

/// Have two boxes a point in common?
inline bool overlap(const Bounds& a, const Bounds& b) { return !Bounds{max(a.lo, b.lo), min(a.hi, b.hi)}.empty(); }

/// Right-handed orthonormal frame around a unit z axis (Duff et al. 2017: no branch, no singularity).
struct Frame {
  Vec3 s, t, n;

  VIRGA_HD explicit Frame(Vec3 z) : n(z) {
    const float sign = std::copysign(1.f, z.z);
    const float a = -1 / (sign + z.z);
    const float b = z.x * z.y * a;
    s = {1 + sign * z.x * z.x * a, sign * b, -sign * z.x};
    t = {b, sign + z.y * z.y * a, -z.y};
  }
  /// The same with s as near to `tangent` (any length) as may be; any s where that points along z.
  VIRGA_HD Frame(Vec3 z, Vec3 tangent) : Frame(z) {
    const Vec3 across = tangent - z * dot(z, tangent);
    const float l2 = lengthSquared(across);
    if (!(l2 > 1e-12f * lengthSquared(tangent))) return;
    s = across / std::sqrt(l2);
    t = cross(n, s);
  }
  VIRGA_HD Vec3 toWorld(Vec3 v) const { return s * v.x + t * v.y + n * v.z; }
  VIRGA_HD Vec3 toLocal(Vec3 v) const { return {dot(s, v), dot(t, v), dot(n, v)}; }
};

}  // namespace virga
