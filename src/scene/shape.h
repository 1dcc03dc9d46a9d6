// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/distribution.h"
#include "core/vec.h"
#include "core/warp.h"
#include "rays/ray_hit.h"
#include "scene/medium.h"

namespace virga {

/// A surface's geometry in world coordinates, to find out about a hit.
struct ShapeView {
  enum class Kind : uint8_t { mesh, sphere, disk, cylinder };

  Kind kind = Kind::mesh;
  const Vec3* positions = nullptr;
  const Vec3* normals = nullptr;  ///< per vertex, or null
  const Vec2* uvs = nullptr;      ///< per vertex, or null
  const std::array<uint32_t, 3>* triangles = nullptr;
  Vec3 center, normal;  ///< sphere, disk; cylinder: one end, and the unit direction to the other
  float radius = 0, length = 0;
  Vec3 axisX{1, 0, 0}, axisY{0, 1, 0}, axisZ{0, 0, 1};  ///< unit images of the axes: where u and v begin
  float orientation = 1;                                ///< -1: normals are flipped
  float area = 0;                                       ///< [unit^2]
  DiscreteView triangleChoice;                          ///< by area

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

/// A point of a shape that was chosen without a ray.
struct ShapePoint {
  Vec3 p, normal;  ///< unit, as the shape orients it
  uint32_t primitive = 0;
  Vec2 barycentric{};
};

/// Uniform by area: where u.x lies tells the triangle of a mesh, the height on a sphere.
VIRGA_HD inline ShapePoint uniformPointOnShape(const ShapeView& shape, Vec2 u) {
  if (shape.kind == ShapeView::Kind::sphere) {
    const Vec3 n = uniformSphere(u);
    return {shape.center + n * shape.radius, n * shape.orientation};
  }
  if (shape.kind == ShapeView::Kind::cylinder) {
    const float phi = kTwoPi * u.x;
    const Vec3 n = shape.axisX * std::cos(phi) + shape.axisY * std::sin(phi);
    return {shape.center + shape.normal * (u.y * shape.length) + n * shape.radius, n * shape.orientation};
  }
  if (shape.kind == ShapeView::Kind::disk) {
    const Vec2 d = uniformDisk(u);
    const Frame frame(shape.normal);
    return {shape.center + (frame.s * d.x + frame.t * d.y) * shape.radius, shape.normal * shape.orientation};
  }
  const auto pick = shape.triangleChoice.sample(u.x);
  const auto& triangle = shape.triangles[pick.index];
  const Vec3 a = shape.positions[triangle[0]], b = shape.positions[triangle[1]], c = shape.positions[triangle[2]];
  const Vec2 uv = uniformTriangle({pick.remapped, u.y});
  return {a * (1 - uv.x - uv.y) + b * uv.x + c * uv.y, normalize(cross(b - a, c - a)) * shape.orientation,
          static_cast<uint32_t>(pick.index), uv};
}

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
  } else if (shape.kind == ShapeView::Kind::cylinder) {
    const Vec3 q = ray.at(hit.t) - shape.center;
    const float along = clamp(dot(q, shape.normal), 0, shape.length);
    const Vec3 outward = normalize(q - shape.normal * dot(q, shape.normal));
    s.p = shape.center + shape.normal * along + outward * shape.radius;
    s.geometricNormal = s.shadingNormal = outward * shape.orientation;
  } else {
    const Vec3 q = ray.at(hit.t);
    s.p = q - shape.normal * dot(q - shape.center, shape.normal);
    s.geometricNormal = s.shadingNormal = shape.normal * shape.orientation;
  }
  s.epsilon = kHitError * std::max(maxComponent(abs(s.p)), 1e-2f * sceneScale);
  return s;
}

/// Azimuth about z, in turns from 0 to 1.
VIRGA_HD inline float turns(float x, float y) {
  const float t = std::atan2(y, x) * (0.5f * kInvPi);
  return t < 0 ? t + 1 : t;
}

/// Texture coordinates of a point, as in Mitsuba 3: sphere (azimuth, polar angle), disk (radius, azimuth), cylinder
/// (azimuth, height), each in [0, 1]; mesh: those of its vertices, and without any the weights of the second and third.
VIRGA_HD inline Vec2 surfaceUv(const ShapeView& shape, Vec3 p, uint32_t primitive, Vec2 barycentric) {
  if (shape.kind == ShapeView::Kind::mesh) {
    if (!shape.uvs) return barycentric;
    const auto& triangle = shape.triangles[primitive];
    return shape.uvs[triangle[0]] * (1 - barycentric.x - barycentric.y) + shape.uvs[triangle[1]] * barycentric.x +
           shape.uvs[triangle[2]] * barycentric.y;
  }
  const Vec3 q = p - shape.center;
  const float x = dot(q, shape.axisX), y = dot(q, shape.axisY);
  if (shape.kind == ShapeView::Kind::disk) return {std::sqrt(x * x + y * y) / shape.radius, turns(x, y)};
  if (shape.kind == ShapeView::Kind::cylinder) return {turns(x, y), dot(q, shape.normal) / shape.length};
  return {turns(x, y), std::acos(clamp(dot(q, shape.axisZ) / shape.radius, -1, 1)) * kInvPi};
}

/// A vector along which u grows (or falls, on a mirrored shape) while v stays; of any length, along the surface.
VIRGA_HD inline Vec3 surfaceTangent(const ShapeView& shape, Vec3 p, uint32_t primitive) {
  if (shape.kind == ShapeView::Kind::sphere) return cross(shape.axisZ, p - shape.center);
  if (shape.kind == ShapeView::Kind::cylinder) return cross(shape.normal, p - shape.center);
  if (shape.kind == ShapeView::Kind::disk) return lengthSquared(p - shape.center) > 0 ? p - shape.center : shape.axisX;
  const auto& triangle = shape.triangles[primitive];
  const Vec3 a = shape.positions[triangle[0]];
  const Vec3 ab = shape.positions[triangle[1]] - a, ac = shape.positions[triangle[2]] - a;
  if (!shape.uvs) return ab;
  const Vec2 b = shape.uvs[triangle[1]] - shape.uvs[triangle[0]], c = shape.uvs[triangle[2]] - shape.uvs[triangle[0]];
  const float determinant = b.x * c.y - b.y * c.x;
  return determinant == 0 ? ab : (ab * c.y - ac * b.y) * (determinant < 0 ? -1.f : 1.f);
}

}  // namespace virga
