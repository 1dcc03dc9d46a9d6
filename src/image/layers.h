// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/rgb.h"

namespace virga {

/// Transport layers: every method's picture is split the same way, and the beauty is their sum.
/// x1 is the first vertex from the eye that scatters, x2 the next one toward the light; perfectly specular vertices do
/// not count. `mediaToSurface`: x1 on a surface, x2 in the medium (the light travels from the medium to the surface).
enum class Layer : uint8_t {
  emission,          ///< emitter or background seen directly, attenuated
  directSurface,     ///< x1 surface, x2 light
  directMedia,       ///< x1 medium, x2 light: single scattering
  causticSurface,    ///< x1 surface, light reached through specular vertices
  causticMedia,      ///< x1 medium, light reached through specular vertices
  surfaceToSurface,  ///< x1 surface, x2 surface
  mediaToSurface,    ///< x1 surface, x2 medium
  surfaceToMedia,    ///< x1 medium, x2 surface
  mediaToMedia,      ///< x1 medium, x2 medium
};

inline constexpr int kLayerCount = 9;

/// Names as they stand in EXR channels and on the command line.
inline constexpr std::array<std::string_view, kLayerCount> kLayerNames = {
    "emission",           "direct_surface",   "direct_media",     "caustic_surface", "caustic_media",
    "surface_to_surface", "media_to_surface", "surface_to_media", "media_to_media"};

/// A set of layers.
struct LayerMask {
  uint32_t bits = 0;

  static constexpr LayerMask none() { return {0}; }
  static constexpr LayerMask all() { return {(1u << kLayerCount) - 1}; }
  constexpr bool has(Layer layer) const { return (bits >> static_cast<int>(layer)) & 1u; }
  constexpr LayerMask with(Layer layer) const { return {bits | (1u << static_cast<int>(layer))}; }
  friend constexpr bool operator==(LayerMask, LayerMask) = default;
};

/// Radiance of one sample, layer by layer [W/(m^2 sr)].
struct LayerRadiance {
  Rgb value[kLayerCount];

  VIRGA_HD void add(Layer layer, Rgb radiance) { value[static_cast<int>(layer)] += radiance; }
  VIRGA_HD LayerRadiance& operator+=(const LayerRadiance& o) {
    for (int l = 0; l < kLayerCount; ++l) value[l] += o.value[l];
    return *this;
  }
  VIRGA_HD Rgb sum() const {
    Rgb total;
    for (const Rgb& v : value) total += v;
    return total;
  }
};

}  // namespace virga
