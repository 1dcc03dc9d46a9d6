// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "rays/ray_hit.h"

namespace virga {

/// Rays from 0 to tMax that are much alike and are traced together. Those with tMax <= 0 take no part.
struct RayPacket {
  static constexpr int kSize = 16;

  alignas(64) float ox[kSize], oy[kSize], oz[kSize];
  alignas(64) float dx[kSize], dy[kSize], dz[kSize];
  alignas(64) float tMax[kSize] = {};

  VIRGA_HD void set(int i, const Ray& ray, float end) {
    ox[i] = ray.o.x, oy[i] = ray.o.y, oz[i] = ray.o.z;
    dx[i] = ray.d.x, dy[i] = ray.d.y, dz[i] = ray.d.z;
    tMax[i] = end;
  }
  VIRGA_HD Ray ray(int i) const { return {{ox[i], oy[i], oz[i]}, {dx[i], dy[i], dz[i]}}; }
};

using PacketHits = std::array<RayHit, RayPacket::kSize>;

}  // namespace virga
