// SPDX-License-Identifier: Apache-2.0
#include "app/dots.h"

#include <algorithm>
#include <cmath>

namespace virga::app {
namespace {

bool hidden(const Scene& scene, Vec3 p) {
  const Vec3 way = p - scene.camera.toWorld.translation;
  const float d = length(way);
  // Dots on surfaces are not hidden by these.
  return scene.surfaceRays->occluded({scene.camera.toWorld.translation, way / d}, 0, d * (1 - 1e-3f));
}

void fillDisk(Image& picture, Vec2 center, float radius, Rgb color) {
  const auto first = [](float x) { return std::max(0, static_cast<int>(std::floor(x))); };
  for (int y = first(center.y - radius); y < picture.height && static_cast<float>(y) <= center.y + radius; ++y)
    for (int x = first(center.x - radius); x < picture.width && static_cast<float>(x) <= center.x + radius; ++x) {
      const float dx = static_cast<float>(x) + 0.5f - center.x, dy = static_cast<float>(y) + 0.5f - center.y;
      if (dx * dx + dy * dy <= radius * radius) picture.at(x, y) = color;
    }
}

}  // namespace

Image withDots(Image picture, const Scene& scene, const Overlay& overlay) {
  const float radius = std::max(1.f, static_cast<float>(picture.width) / 400);
  for (const Overlay::Dot& dot : overlay.dots) {
    Vec2 at;
    if (scene.camera.project(dot.position, at) && !hidden(scene, dot.position))
      fillDisk(picture, at, radius, dot.color);
  }
  return picture;
}

}  // namespace virga::app
