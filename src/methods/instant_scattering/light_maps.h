// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <span>
#include <stop_token>
#include <vector>

#include "methods/instant_scattering/frame_kernels.h"
#include "transport/virtual_lights.h"

namespace virga {

/// Shadow maps of a frame's lights, as its kernels take them.
class LightMaps {
 public:
  struct Options {
    int resolution = 32;  ///< of a map, texels in either direction
    int points = 0;       ///< of the surfaces, in each map; 0: a ray for each texel
  };

  /// `before`: maps of the same surfaces, by the same options; those of lights that stand where they stood are taken
  /// from there. Null: there are none. A stop leaves maps undefined.
  LightMaps(const Scene& scene, std::span<const LightVertex> lights, const Options& options, const LightMaps* before,
            const std::stop_token& stop);

  /// Of light number i.
  KernelShadowMap map(size_t i) const;

 private:
  using Place = std::array<float, 6>;
  static Place placeOf(const LightVertex& light);
  size_t texels() const { return static_cast<size_t>(side_) * static_cast<size_t>(side_); }

  int side_;                         ///< texels of a map in either direction
  std::vector<float> depths_;        ///< map after map
  std::map<Place, size_t> numbers_;  ///< of the maps
};

}  // namespace virga
