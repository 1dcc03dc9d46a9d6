// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/rgb.h"

namespace virga {

/// A colour that varies over a surface: a picture, or a board of two colours. Plain data; the Scene owns the pixels.
/// As in Mitsuba 3, v = 0 is the first row of pixels, and pixel i covers [i, i + 1) / width.
struct TextureView {
  enum class Kind : uint8_t { none, bitmap, checkerboard };
  enum class Wrap : uint8_t { repeat, mirror, clamp };
  enum class Filter : uint8_t { bilinear, nearest };

  Kind kind = Kind::none;
  Wrap wrap = Wrap::repeat;
  Filter filter = Filter::bilinear;
  const Rgb* pixels = nullptr;  ///< by rows
  int width = 0, height = 0;
  Rgb color0, color1;         ///< of the checkerboard
  float uRow[3] = {1, 0, 0};  ///< to_uv: the first row of the matrix that (u, v, 1) goes through
  float vRow[3] = {0, 1, 0};
  float scale = 1;  ///< of all values

  VIRGA_HD bool present() const { return kind != Kind::none; }

  VIRGA_HD Rgb lookup(Vec2 uv) const {
    const float u = uRow[0] * uv.x + uRow[1] * uv.y + uRow[2], v = vRow[0] * uv.x + vRow[1] * uv.y + vRow[2];
    if (kind == Kind::checkerboard) return (lowHalf(u) == lowHalf(v) ? color0 : color1) * scale;
    const float x = u * static_cast<float>(width), y = v * static_cast<float>(height);
    return (filter == Filter::nearest ? pixel(column(x), row(y)) : bilinear(x - 0.5f, y - 0.5f)) * scale;
  }

 private:
  VIRGA_HD static bool lowHalf(float x) { return x - std::floor(x) < 0.5f; }

  VIRGA_HD Rgb bilinear(float x, float y) const {
    const float fx = x - std::floor(x), fy = y - std::floor(y);
    const int i0 = column(x), i1 = column(std::floor(x) + 1), j0 = row(y), j1 = row(std::floor(y) + 1);
    // As a step from one value toward the other: between equal pixels the result is that value, to the bit.
    const auto mix = [](Rgb a, Rgb b, float t) { return a + (b - a) * t; };
    return mix(mix(pixel(i0, j0), pixel(i1, j0), fx), mix(pixel(i0, j1), pixel(i1, j1), fx), fy);
  }
  VIRGA_HD Rgb pixel(int i, int j) const {
    return pixels[static_cast<size_t>(j) * static_cast<size_t>(width) + static_cast<size_t>(i)];
  }
  VIRGA_HD int column(float x) const { return wrapped(x, width); }
  VIRGA_HD int row(float y) const { return wrapped(y, height); }
  // The pixel of `count` in a row that the coordinate lies in. By remainders of floats: it may be too large for an int.
  VIRGA_HD int wrapped(float x, int count) const {
    const float n = static_cast<float>(count), period = wrap == Wrap::mirror ? 2 * n : n, whole = std::floor(x);
    if (wrap == Wrap::clamp) return static_cast<int>(clamp(whole, 0, n - 1));
    const float rest = clamp(whole - period * std::floor(whole / period), 0, period - 1);
    const int i = static_cast<int>(rest);
    return i < count ? i : 2 * count - 1 - i;
  }
};

}  // namespace virga
