// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/vec.h"

namespace virga {

/// Linear RGB with the primaries and white point of sRGB (ITU-R BT.709). Radiance, throughput, albedo, coefficient.
struct Rgb {
  float r = 0, g = 0, b = 0;

  constexpr Rgb() = default;
  VIRGA_HD constexpr Rgb(float r_, float g_, float b_) : r(r_), g(g_), b(b_) {}
  VIRGA_HD explicit constexpr Rgb(float s) : r(s), g(s), b(s) {}

  VIRGA_HD constexpr float operator[](int i) const { return i == 0 ? r : (i == 1 ? g : b); }
  VIRGA_HD constexpr float& operator[](int i) { return i == 0 ? r : (i == 1 ? g : b); }

  friend VIRGA_HD constexpr Rgb operator+(Rgb a, Rgb b) { return {a.r + b.r, a.g + b.g, a.b + b.b}; }
  friend VIRGA_HD constexpr Rgb operator-(Rgb a, Rgb b) { return {a.r - b.r, a.g - b.g, a.b - b.b}; }
  friend VIRGA_HD constexpr Rgb operator*(Rgb a, Rgb b) { return {a.r * b.r, a.g * b.g, a.b * b.b}; }
  friend VIRGA_HD constexpr Rgb operator/(Rgb a, Rgb b) { return {a.r / b.r, a.g / b.g, a.b / b.b}; }
  friend VIRGA_HD constexpr Rgb operator*(Rgb a, float s) { return {a.r * s, a.g * s, a.b * s}; }
  friend VIRGA_HD constexpr Rgb operator*(float s, Rgb a) { return a * s; }
  friend VIRGA_HD constexpr Rgb operator/(Rgb a, float s) { return a * (1 / s); }
  VIRGA_HD constexpr Rgb& operator+=(Rgb o) { return *this = *this + o; }
  VIRGA_HD constexpr Rgb& operator*=(Rgb o) { return *this = *this * o; }
  VIRGA_HD constexpr Rgb& operator*=(float s) { return *this = *this * s; }
  friend constexpr bool operator==(Rgb, Rgb) = default;
};

VIRGA_HD constexpr float maxComponent(Rgb c) { return std::max(c.r, std::max(c.g, c.b)); }
VIRGA_HD constexpr float minComponent(Rgb c) { return std::min(c.r, std::min(c.g, c.b)); }
VIRGA_HD constexpr float mean(Rgb c) { return (c.r + c.g + c.b) / 3; }
VIRGA_HD constexpr float luminance(Rgb c) { return 0.212671f * c.r + 0.715160f * c.g + 0.072169f * c.b; }
VIRGA_HD constexpr Rgb lerp(Rgb a, Rgb b, float t) { return a + (b - a) * t; }
VIRGA_HD constexpr bool isBlack(Rgb c) { return c.r == 0 && c.g == 0 && c.b == 0; }
VIRGA_HD constexpr bool isGrey(Rgb c) { return c.r == c.g && c.g == c.b; }
VIRGA_HD inline Rgb exp(Rgb c) { return {std::exp(c.r), std::exp(c.g), std::exp(c.b)}; }
VIRGA_HD inline bool isFinite(Rgb c) { return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b); }

}  // namespace virga
