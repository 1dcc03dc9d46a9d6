// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "core/rgb.h"

namespace virga {

/// Linear RGB pixels, row by row from the top left.
struct Image {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;  ///< width * height

  Image() = default;
  Image(int w, int h, Rgb fill = {})
      : width(w), height(h), pixels(static_cast<size_t>(w) * static_cast<size_t>(h), fill) {}

  Rgb& at(int x, int y) { return pixels[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)]; }
  const Rgb& at(int x, int y) const {
    return pixels[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
  }
};

}  // namespace virga
