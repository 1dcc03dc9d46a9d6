// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/transform.h"
#include "core/vec.h"
#include "rays/ray_hit.h"
#include "rays/ray_packet.h"

namespace virga {

/// One shape, ready to be traced, in world coordinates. Immutable, shared between scenes.
class RayShape {
 public:
  /// The arrays must outlive the shape and end with 16 readable bytes (Embree reads past the last vertex).
  static std::shared_ptr<const RayShape> triangles(std::span<const Vec3> positions,
                                                   std::span<const std::array<uint32_t, 3>> triangles);
  static std::shared_ptr<const RayShape> sphere(Vec3 center, float radius);
  static std::shared_ptr<const RayShape> disk(Vec3 center, Vec3 unitNormal, float radius);
  /// The side of a tube from `end` along `unitAxis`, open at its ends.
  static std::shared_ptr<const RayShape> cylinder(Vec3 end, Vec3 unitAxis, float radius, float length);
  /// The image of [-1, 1]^3, as a boundary that rays enter and leave.
  static std::shared_ptr<const RayShape> box(const Matrix4& toWorld);

  /// Do the bounds of any of its parts (triangles, or all of it) overlap `box`?
  bool mayMeet(const Bounds& box) const;

  struct Impl;
  const Impl& impl() const { return *impl_; }
  explicit RayShape(std::unique_ptr<Impl>);
  ~RayShape();

 private:
  std::unique_ptr<Impl> impl_;
};

/// A set of shapes with an acceleration structure (Embree). Of two levels where shapes have moved: those that stand
/// are sorted together, each that moved for itself, and all of these under one top (docs/decisions/moving-shapes.md).
class RayScene {
 public:
  using Shapes = std::vector<std::shared_ptr<const RayShape>>;

  /// What is sorted in `previous` already is taken from there: the shapes that have been standing, if all of them are
  /// here still, and those that have moved before. Queries find the same as in a scene without a previous one.
  explicit RayScene(Shapes shapes, const RayScene* previous = nullptr);
  ~RayScene();

  bool empty() const { return shapes_.empty(); }
  const Shapes& shapes() const { return shapes_; }
  /// How many shapes are sorted by themselves.
  int movedShapes() const;
  /// Of all shapes.
  Bounds bounds() const;
  /// Do both have their standing shapes in one and the same structure?
  bool sharesStandingShapes(const RayScene& other) const;
  /// Nearest hit with tMin < t < tMax.
  RayHit nearest(const Ray& ray, float tMin, float tMax) const;
  /// Anything with tMin < t < tMax?
  bool occluded(const Ray& ray, float tMin, float tMax) const;
  /// nearest() of each ray of a packet; nothing is found for those that take no part.
  PacketHits nearest(const RayPacket& rays) const;
  /// Bit i: something lies within the range of ray i.
  uint32_t occluded(const RayPacket& rays) const;
  /// A lower bound of the distance from p to any shape, infinity where there is none: for triangles, spheres and disks
  /// the distance itself, within its rounding. Shapes that nowhere rise above a plane through p with one of the unit
  /// `sides` as its normal (beyond the errors of coordinates) do not count; without sides, all do.
  float clearance(Vec3 p, std::span<const Vec3> sides) const;
  /// All crossings with 0 <= tMin <= t <= tMax (those of triangles: tMin < t). The same ray finds them at the same t in
  /// every call.
  void crossings(const Ray& ray, float tMin, float tMax, CrossingList& list) const;

 private:
  struct Impl;
  Shapes shapes_;
  std::unique_ptr<Impl> impl_;
};

/// The ray queries that kernels need, over Embree. A device has its own type with the same functions.
struct EmbreeRays {
  const RayScene& surfaces;
  const RayScene& boundaries;

  RayHit nearest(const Ray& ray, float tMax) const { return surfaces.nearest(ray, 0, tMax); }
  bool occluded(const Ray& ray, float tMax) const { return surfaces.occluded(ray, 0, tMax); }
  /// A bit for each ray.
  uint32_t occluded(const RayPacket& rays) const { return surfaces.occluded(rays); }
  void crossings(const Ray& ray, float tMin, float tMax, CrossingList& list) const {
    boundaries.crossings(ray, tMin, tMax, list);
  }
};

}  // namespace virga
