// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "core/sampler.h"
#include "core/transform.h"
#include "core/vec.h"

namespace virga {

/// Reconstruction filter, sampled (filter importance sampling): every sample has weight 1 and pixels stay independent.
struct PixelFilter {
  enum class Kind : uint8_t { box, tent, gaussian };
  static constexpr int kTableSize = 256;

  Kind kind = Kind::box;
  float radius = 0.5f;  ///< [pixels]
  /// Gaussian: offset [pixels] beyond which lies the share v^2 of a half of the filter, at v = i / kTableSize. The
  /// square root resolves the tails, where the offset as a function of the share itself is steep.
  std::array<float, kTableSize + 1> tail{};

  /// Offset from the pixel's centre [pixels].
  VIRGA_HD Vec2 sample(Vec2 u) const { return {sample1D(u.x), sample1D(u.y)}; }

 private:
  VIRGA_HD float sample1D(float u) const {
    if (kind == Kind::box) return (2 * u - 1) * radius;
    if (kind == Kind::tent) return u < 0.5f ? radius * (std::sqrt(2 * u) - 1) : radius * (1 - std::sqrt(2 - 2 * u));
    const float side = 2 * u - 1, x = std::sqrt(1 - std::fabs(side)) * kTableSize;
    const int i = x < kTableSize ? static_cast<int>(x) : kTableSize - 1;
    const float offset =
        lerp(tail[static_cast<size_t>(i)], tail[static_cast<size_t>(i + 1)], x - static_cast<float>(i));
    return std::copysign(offset, side);
  }
};

struct CameraRay {
  Ray ray;         ///< starts on the near plane
  float tMax = 0;  ///< at the far plane
};

/// Pinhole camera that looks along +z of its own frame, +x to the left of the picture, +y up.
struct PerspectiveCamera {
  Affine toWorld;
  float tanX = 1, tanY = 1;  ///< tangents of half the field of view
  float shiftX = 0,
        shiftY = 0;  ///< of the film against the optical axis, in its widths and heights (principal point offset)
  float nearClip = 1e-2f, farClip = 1e4f;           ///< distances along the axis [unit]
  int filmWidth = 1, filmHeight = 1;                ///< of the whole film [pixels]
  int cropX = 0, cropY = 0, width = 1, height = 1;  ///< the part that is rendered [pixels]

  /// Number of a pixel on the whole film, so that a crop window is given the very same random numbers.
  VIRGA_HD uint32_t pixelStream(int x, int y) const {
    return static_cast<uint32_t>(y + cropY) * static_cast<uint32_t>(filmWidth) + static_cast<uint32_t>(x + cropX);
  }

  /// (x, y) in pixels of the crop window, from its top left corner.
  VIRGA_HD CameraRay ray(float x, float y) const {
    const float sx = 1 - 2 * ((x + static_cast<float>(cropX)) / static_cast<float>(filmWidth) + shiftX);
    const float sy = 1 - 2 * ((y + static_cast<float>(cropY)) / static_cast<float>(filmHeight) + shiftY);
    const Vec3 local = normalize(Vec3(sx * tanX, sy * tanY, 1));
    const Vec3 d = normalize(toWorld.vector(local));
    const float inverseZ = 1 / local.z;
    return {{toWorld.translation + d * (nearClip * inverseZ), d}, (farClip - nearClip) * inverseZ};
  }
  /// Where a point shows, in pixels of the crop window; false behind the camera.
  VIRGA_HD bool project(Vec3 p, Vec2& at) const {
    const Vec3 x = toWorld.vector({1, 0, 0}), y = toWorld.vector({0, 1, 0}), z = toWorld.vector({0, 0, 1});
    const Vec3 v = p - toWorld.translation;
    const float depth = dot(v, cross(x, y)) / dot(x, cross(y, z));
    if (!(depth > 0)) return false;
    const float scale = 1 / (depth * dot(x, cross(y, z)));
    const float sx = dot(v, cross(y, z)) * scale / tanX, sy = dot(v, cross(z, x)) * scale / tanY;
    at = {((1 - sx) * 0.5f - shiftX) * static_cast<float>(filmWidth) - static_cast<float>(cropX),
          ((1 - sy) * 0.5f - shiftY) * static_cast<float>(filmHeight) - static_cast<float>(cropY)};
    return true;
  }
};

}  // namespace virga
