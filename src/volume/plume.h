// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace virga {

/// A block of divergence-free noise that repeats, tabulated once: the eddies of a flow.
class CurlTile {
 public:
  explicit CurlTile(uint32_t seed);
  /// Velocity of about unit size; the tile's period is kPeriod.
  Vec3 lookup(Vec3 p) const;

  static constexpr int kPeriod = 8;

 private:
  static constexpr int kSamples = 64;  // per axis
  std::vector<Vec3> velocity_;
};

/// Density of a rising, turbulent plume in [0, 1]. A steady plume looks the same at every height when lengths are
/// measured in its own radius R, which grows linearly with height (Morton, Taylor, Turner 1956). So the flow is
/// followed in similarity coordinates, q = (x, z) / R and zeta = the integral of dy / R, where the plume is a cylinder
/// and its eddies have one size. Every point is traced back through the eddies for as long as an eddy lives; the smoke
/// was in a smooth column then.
class Plume {
 public:
  explicit Plume(uint32_t seed) : eddies_(seed), seed_(seed) {}
  /// p in [-1, 1]^3, time in frames.
  float density(Vec3 p, float frame) const;

 private:
  struct Parcel {
    Vec3 at;     // q.x, zeta, q.z
    float time;  // [R / speed]
  };
  Parcel tracedBack(Parcel parcel) const;
  Vec3 velocity(const Parcel& parcel) const;
  float column(const Parcel& parcel) const;

  CurlTile eddies_;
  uint32_t seed_;
};

}  // namespace virga
