// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/transform.h"
#include "core/vec.h"

namespace virga {

/// What a ray met: the shape's index in its RayScene, the primitive (triangle) and where on it.
struct RayHit {
  static constexpr uint32_t kNone = ~0u;
  float t = kInfinity;
  uint32_t shape = kNone;
  uint32_t primitive = 0;
  float u = 0, v = 0;  ///< barycentric weights of the triangle's second and third vertex

  VIRGA_HD bool found() const { return shape != kNone; }
};

/// A ray passes a boundary.
struct Crossing {
  float t;
  uint32_t shape;
  bool entering;
};

/// The nearest crossings of a ray, sorted by t; entries beyond the capacity are dropped from the far end, and `complete` tells.
struct CrossingList {
  static constexpr int kCapacity = 32;
  std::array<Crossing, kCapacity> items;
  int count = 0;
  bool complete = true;

  void insert(const Crossing& c) {
    if (count == kCapacity) {
      complete = false;
      if (c.t >= items[kCapacity - 1].t) return;
      --count;
    }
    int i = count++;
    for (; i > 0 && items[static_cast<size_t>(i - 1)].t > c.t; --i)
      items[static_cast<size_t>(i)] = items[static_cast<size_t>(i - 1)];
    items[static_cast<size_t>(i)] = c;
  }
  std::span<const Crossing> crossings() const { return {items.data(), static_cast<size_t>(count)}; }
};

/// One shape, ready to be traced, in world coordinates. Immutable, shared between scenes.
class RayShape {
 public:
  /// The arrays must outlive the shape and end with 16 readable bytes (Embree reads past the last vertex).
  static std::shared_ptr<const RayShape> triangles(std::span<const Vec3> positions,
                                                   std::span<const std::array<uint32_t, 3>> triangles);
  static std::shared_ptr<const RayShape> sphere(Vec3 center, float radius);
  static std::shared_ptr<const RayShape> disk(Vec3 center, Vec3 unitNormal, float radius);
  /// The image of [-1, 1]^3, as a boundary that rays enter and leave.
  static std::shared_ptr<const RayShape> box(const Matrix4& toWorld);

  struct Impl;
  const Impl& impl() const { return *impl_; }
  explicit RayShape(std::unique_ptr<Impl>);
  ~RayShape();

 private:
  std::unique_ptr<Impl> impl_;
};

/// A set of shapes with an acceleration structure (Embree).
class RayScene {
 public:
  explicit RayScene(std::vector<std::shared_ptr<const RayShape>> shapes);
  ~RayScene();

  bool empty() const { return shapes_.empty(); }
  /// Nearest hit with tMin < t < tMax.
  RayHit nearest(const Ray& ray, float tMin, float tMax) const;
  /// Anything with tMin < t < tMax?
  bool occluded(const Ray& ray, float tMin, float tMax) const;
  /// All crossings with tMin <= t <= tMax, t possibly negative.
  void crossings(const Ray& ray, float tMin, float tMax, CrossingList& list) const;

 private:
  struct Impl;
  std::vector<std::shared_ptr<const RayShape>> shapes_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace virga
