// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/vec.h"

namespace virga {

/// Unit vector from polar angle (as sine and cosine about z) and azimuth [rad].
VIRGA_HD inline Vec3 sphericalDirection(float sinTheta, float cosTheta, float phi) {
  return {sinTheta * std::cos(phi), sinTheta * std::sin(phi), cosTheta};
}

/// Uniform on the unit sphere; density 1 / (4 pi) [1/sr].
VIRGA_HD inline Vec3 uniformSphere(Vec2 u) {
  const float z = 1 - 2 * u.x;
  return sphericalDirection(2 * std::sqrt(std::max(0.f, u.x * (1 - u.x))), z, kTwoPi * u.y);
}

/// Uniform on the unit disk (concentric map of Shirley and Chiu 1997); density 1 / pi.
VIRGA_HD inline Vec2 uniformDisk(Vec2 u) {
  const float a = 2 * u.x - 1, b = 2 * u.y - 1;
  if (a == 0 && b == 0) return {0, 0};
  const bool wide = std::fabs(a) > std::fabs(b);
  const float r = wide ? a : b;
  const float phi = wide ? (kPi / 4) * (b / a) : (kPi / 2) - (kPi / 4) * (a / b);
  return {r * std::cos(phi), r * std::sin(phi)};
}

/// Cosine-weighted about +z; density cos(theta) / pi [1/sr].
VIRGA_HD inline Vec3 cosineHemisphere(Vec2 u) {
  const Vec2 d = uniformDisk(u);
  return {d.x, d.y, std::sqrt(std::max(0.f, 1 - d.x * d.x - d.y * d.y))};
}

/// Uniform within the cone about +z with 1 - cos(half angle) = `height`; density 1 / (2 pi height) [1/sr]. Takes the
/// height and not the cosine: for far lights the cosine rounds to 1.
VIRGA_HD inline Vec3 uniformCone(Vec2 u, float height) {
  const float v = u.x * height;  // 1 - cos(theta)
  return sphericalDirection(std::sqrt(std::max(0.f, v * (2 - v))), 1 - v, kTwoPi * u.y);
}

/// Barycentric weights (of the second and third vertex), uniform on a triangle.
VIRGA_HD inline Vec2 uniformTriangle(Vec2 u) {
  const float s = std::sqrt(u.x);
  return {1 - s, u.y * s};
}

}  // namespace virga
