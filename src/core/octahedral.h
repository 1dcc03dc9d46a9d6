// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/vec.h"

namespace virga {

/// Directions on a square (Engelhardt and Dachsbacher 2008): the octahedron |x| + |y| + |z| = 1 seen along z, its lower
/// half folded outward.

/// Along either axis of the square a place moves by no more than so many times what its direction turns [1/rad].
inline constexpr float kOctahedralSpeed = 1.41421356f;

/// Of a direction of any length but 0, to [-1, 1]^2.
VIRGA_HD inline Vec2 toOctahedron(Vec3 w) {
  const float scale = 1 / (std::fabs(w.x) + std::fabs(w.y) + std::fabs(w.z));
  const float x = w.x * scale, y = w.y * scale;
  const float foldedX = std::copysign(1 - std::fabs(y), x), foldedY = std::copysign(1 - std::fabs(x), y);
  return w.z < 0 ? Vec2{foldedX, foldedY} : Vec2{x, y};
}

/// From [-1, 1]^2, to a unit direction.
VIRGA_HD inline Vec3 fromOctahedron(Vec2 q) {
  const float z = 1 - std::fabs(q.x) - std::fabs(q.y);
  const float x = z < 0 ? std::copysign(1 - std::fabs(q.y), q.x) : q.x;
  const float y = z < 0 ? std::copysign(1 - std::fabs(q.x), q.y) : q.y;
  return normalize(Vec3(x, y, z));
}

/// A texel of a square of resolution^2 texels.
struct OctahedralTexel {
  int x, y;

  VIRGA_HD int index(int resolution) const { return y * resolution + x; }
};

VIRGA_HD inline OctahedralTexel octahedralTexel(Vec3 w, int resolution) {
  const Vec2 q = toOctahedron(w);
  const float half = 0.5f * static_cast<float>(resolution);
  const auto place = [&](float c) { return std::min(static_cast<int>((c + 1) * half), resolution - 1); };
  return {place(q.x), place(q.y)};
}

/// Direction of a texel's middle.
VIRGA_HD inline Vec3 octahedralDirection(OctahedralTexel t, int resolution) {
  const float size = 2 / static_cast<float>(resolution);
  return fromOctahedron({(static_cast<float>(t.x) + 0.5f) * size - 1, (static_cast<float>(t.y) + 0.5f) * size - 1});
}

/// The texel that lies at a place up to one resolution outside of the square: at each border it goes on mirrored.
VIRGA_HD inline OctahedralTexel wrapOctahedral(OctahedralTexel t, int resolution) {
  if (t.x < 0 || t.x >= resolution) t = {t.x < 0 ? -1 - t.x : 2 * resolution - 1 - t.x, resolution - 1 - t.y};
  if (t.y < 0 || t.y >= resolution) t = {resolution - 1 - t.x, t.y < 0 ? -1 - t.y : 2 * resolution - 1 - t.y};
  return t;
}

}  // namespace virga
