// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

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
  bool doubtful = false;  ///< on the edge of a triangle: rounding may have kept the ray from its neighbour
};

/// The nearest crossings of a ray, sorted by t; entries beyond the capacity are dropped from the far end, and
/// `complete` tells.
struct CrossingList {
  static constexpr int kCapacity = 32;
  Crossing items[kCapacity];
  int count = 0;
  bool complete = true;

  VIRGA_HD void insert(const Crossing& c) {
    if (count == kCapacity) {
      complete = false;
      if (c.t >= items[kCapacity - 1].t) return;
      --count;
    }
    int i = count++;
    for (; i > 0 && items[i - 1].t > c.t; --i) items[i] = items[i - 1];
    items[i] = c;
  }
  VIRGA_HD void clear() { count = 0, complete = true; }
};

}  // namespace virga
