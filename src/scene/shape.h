// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/vec.h"
#include "rays/ray_hit.h"
#include "scene/medium.h"

namespace virga {

/// A surface's geometry in world coordinates, to find out about a hit.
struct ShapeView {
  enum class Kind : uint8_t { mesh, sphere, disk };

  Kind kind = Kind::mesh;
  const Vec3* positions = nullptr;
  const Vec3* normals = nullptr;  ///< per vertex, or null
  const std::array<uint32_t, 3>* triangles = nullptr;
  Vec3 center, normal;  ///< sphere, disk
  float radius = 0;
  float orientation = 1;  ///< -1: normals are flipped

  int bsdf = 0;
  int emitter = -1;  ///< index of the area emitter on it
  MediumTransition media;
};

/// A point on a surface.
struct SurfacePoint {
  Vec3 p;
  Vec3 geometricNormal;  ///< unit, as the shape orients it
  Vec3 shadingNormal;    ///< unit, on the same side
  uint32_t shape = 0;
  float epsilon = 0;  ///< [unit] by how much p may lie off the surface

  /// Where a ray that leaves toward w starts: a little off the surface on w's side.
  VIRGA_HD Vec3 originToward(Vec3 w) const {
    return p + geometricNormal * (dot(w, geometricNormal) >= 0 ? epsilon : -epsilon);
  }
};

/// Relative error of a computed hit position: 17 times the rounding of a coordinate, so that no ray meets again what it
/// leaves (tests/scene/test_limits.cpp), and small beside shapes even where they lie far from the origin.
inline constexpr float kHitError = 2e-6f;

VIRGA_HD inline SurfacePoint surfacePoint(const ShapeView& shape, const Ray& ray, const RayHit& hit, float sceneScale) {
  SurfacePoint s;
  s.shape = hit.shape;
  if (shape.kind == ShapeView::Kind::mesh) {
    const auto& triangle = shape.triangles[hit.primitive];
    const Vec3 a = shape.positions[triangle[0]], b = shape.positions[triangle[1]], c = shape.positions[triangle[2]];
    const float w = 1 - hit.u - hit.v;
    s.p = a * w + b * hit.u + c * hit.v;
    s.geometricNormal = normalize(cross(b - a, c - a)) * shape.orientation;
    s.shadingNormal = s.geometricNormal;
    if (shape.normals) {
      const Vec3 n =
          shape.normals[triangle[0]] * w + shape.normals[triangle[1]] * hit.u + shape.normals[triangle[2]] * hit.v;
      const float l2 = lengthSquared(n);
      if (l2 > 0) s.shadingNormal = n * ((dot(n, s.geometricNormal) < 0 ? -1 : 1) / std::sqrt(l2));
    }
  } else if (shape.kind == ShapeView::Kind::sphere) {
    const Vec3 outward = normalize(ray.at(hit.t) - shape.center);
    s.p = shape.center + outward * shape.radius;
    s.geometricNormal = s.shadingNormal = outward * shape.orientation;
  } else {
    const Vec3 q = ray.at(hit.t);
    s.p = q - shape.normal * dot(q - shape.center, shape.normal);
    s.geometricNormal = s.shadingNormal = shape.normal * shape.orientation;
  }
  s.epsilon = kHitError * std::max(maxComponent(abs(s.p)), 1e-2f * sceneScale);
  return s;
}

}  // namespace virga
