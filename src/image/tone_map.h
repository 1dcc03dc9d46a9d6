// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "core/rgb.h"

namespace virga {

/// Transfer curve of sRGB (IEC 61966-2-1) and its inverse, on [0, 1].
inline float linearToSrgb(float x) { return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f; }
inline float srgbToLinear(float x) { return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f); }

/// From linear radiance to a display: times 2^exposure, cut to [0, 1], sRGB curve. There is no shoulder, on purpose:
/// equal numbers in two pictures show as equal colours, and what is too bright for the display shows as white.
struct ToneMap {
  float exposure = 0;  ///< [stops]
};

/// 8-bit sRGB. A pixel with a NaN or an infinity is magenta, so that it is seen.
inline std::array<uint8_t, 3> toneMapped(Rgb linear, const ToneMap& map = {}) {
  if (!isFinite(linear)) return {255, 0, 255};
  const Rgb exposed = linear * std::exp2(map.exposure);
  std::array<uint8_t, 3> out;
  for (int c = 0; c < 3; ++c) {
    const float display = linearToSrgb(std::clamp(exposed[c], 0.f, 1.f));
    out[static_cast<size_t>(c)] = static_cast<uint8_t>(std::lround(255 * display));
  }
  return out;
}

}  // namespace virga
