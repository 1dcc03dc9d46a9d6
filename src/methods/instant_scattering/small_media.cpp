// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/small_media.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "methods/instant_scattering/upsampling.h"
#include "transport/media_bounds.h"

namespace virga {
namespace {

constexpr size_t kMostParts = 8;
/// Measured: docs/decisions/media-far-apart.md.
constexpr int kSmallCells = 16;

/// The pixels that a box shows on, wherever they are; nothing if it reaches behind the camera.
std::optional<Bounds> pixelsOf(const PerspectiveCamera& camera, const Bounds& box) {
  Bounds shown;
  for (int i = 0; i < 8; ++i) {
    Vec2 at;
    if (!camera.project(box.corner(i), at)) return std::nullopt;
    shown.extend(Vec3(at.x, at.y, 0));
  }
  return shown;
}

/// [first, last) of the pixels of a row or column that a stretch of it touches.
std::pair<int, int> touched(float lo, float hi, int size) {
  const auto within = [&](float x) { return static_cast<int>(clamp(x, 0, static_cast<float>(size))); };
  return {within(std::floor(lo)), within(std::ceil(hi))};
}

}  // namespace

void setSmallMediaApart(const Scene& scene, int spacing, int width, int height, std::span<PixelFeatures> features) {
  const float small = kSmallCells * square(static_cast<float>(spacing));
  for (const Bounds& box : boxesOfMedia(scene, kMostParts)) {
    const std::optional<Bounds> shown = pixelsOf(scene.camera, box);
    if (!shown || !(shown->extent().x * shown->extent().y <= small)) continue;
    const auto [x0, x1] = touched(shown->lo.x, shown->hi.x, width);
    const auto [y0, y1] = touched(shown->lo.y, shown->hi.y, height);
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) {
        PixelFeatures& f = features[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
        if (maxComponent(f.opacity) > Upsampling::kFaint) f.regular = false;
      }
  }
}

}  // namespace virga
