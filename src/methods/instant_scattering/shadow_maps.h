// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "core/octahedral.h"
#include "methods/instant_scattering/surface_points.h"
#include "rays/ray_scene.h"
#include "transport/virtual_lights.h"

namespace virga {

/// Distances to the nearest surface around each virtual light, as an octahedral map: the upper halves of floats, a
/// light's map after the other. Right to 1 part in 512; infinite where nothing is met.
struct ShadowMapsView {
  const uint16_t* depths = nullptr;
  int resolution = 0;

  /// A surface is taken to block what lies behind it by more than this many texels' width, as it is seen at the
  /// receiver: what is nearer may be the receiver itself.
  static constexpr float kBias = 2;
  /// Seen at a flatter angle than this cosine, the bias grows no more.
  static constexpr float kLeastCosine = 0.1f;

  VIRGA_HD float depth(size_t light, Vec3 way) const {
    const auto texels = static_cast<size_t>(resolution) * static_cast<size_t>(resolution);
    const auto texel = static_cast<size_t>(octahedralTexel(way, resolution).index(resolution));
    return std::bit_cast<float>(static_cast<uint32_t>(depths[light * texels + texel]) << 16);
  }
  /// Does light number `light` reach the point that lies at `way` (any length but 0) from it, `distance` [unit] away?
  /// `cosine`: of the way to the receiver's normal; 1 in a medium. An approximation: see ShadowMaps.
  VIRGA_HD bool visible(size_t light, Vec3 way, float distance, float cosine = 1) const {
    const float texel = 2 / static_cast<float>(resolution);
    const float bias = std::min(kBias * texel / std::fmax(cosine, kLeastCosine), 0.5f);
    return distance * (1 - bias) <= depth(light, way);
  }
};

struct ShadowMapOptions {
  int resolution = 128;  ///< of each map, texels in either direction
  uint64_t seed = 0;     ///< with the light's number, says which
};

/// Imperfect shadow maps (Ritschel et al. 2008) of virtual lights, on the octahedron as in section 5 of the
/// instant-scattering paper. Every light draws its own random subset of the surfaces' disks, and holes are closed from
/// their surroundings. Shadows are off by about the width of a disk or a texel, and thin things may let light through.
/// All surfaces block, glass as well; the boundaries of media do not.
class ShadowMaps {
 public:
  /// Directions of a map's texels, coordinate by coordinate; with a block of zeros behind them, for vector code.
  struct Directions {
    static constexpr int kBlock = 8;
    std::vector<float> x, y, z;

    Directions() = default;
    explicit Directions(int resolution);
  };

  ShadowMaps() = default;
  /// In parallel; each map is a function of the points, the options, the light and its number alone. A stop leaves maps
  /// undefined.
  ShadowMaps(const SurfacePoints& points, std::span<const LightVertex> lights, const ShadowMapOptions& options,
             const std::stop_token& stop = {});

  /// Without points: each texel's depth is that of a ray through its middle, from `offset` [unit] beside a light's
  /// surface.
  ShadowMaps(const RayScene& surfaces, float offset, std::span<const LightVertex> lights,
             const ShadowMapOptions& options, const std::stop_token& stop = {});

  ShadowMapsView view() const { return {depths_.data(), options_.resolution}; }
  size_t count() const { return depths_.size() / texels(); }
  /// [bytes]
  static size_t memory(size_t lights, int resolution) {
    return lights * sizeof(uint16_t) * static_cast<size_t>(resolution) * static_cast<size_t>(resolution);
  }
  /// Draws map number `index` anew, for a light that has moved or points that have. Different maps may be drawn at the
  /// same time.
  void draw(const SurfacePoints& points, const LightVertex& light, size_t index);

 private:
  void trace(const RayScene& surfaces, float offset, const LightVertex& light, size_t index);
  size_t texels() const { return static_cast<size_t>(options_.resolution) * static_cast<size_t>(options_.resolution); }

  ShadowMapOptions options_;
  Directions directions_;
  std::vector<uint16_t> depths_;
};

}  // namespace virga
