// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <stop_token>

#include "core/parallel.h"
#include "core/sampler.h"
#include "image/film.h"
#include "scene/scene.h"

namespace virga {

/// body(x, y) for each pixel of the frame, tile by tile on all threads; returns early when it shall stop.
template <class Body>
void forEachPixel(const PassFrame& frame, const std::stop_token& stop, const Body& body) {
  constexpr int kTile = 16;
  const int tilesX = (frame.width() + kTile - 1) / kTile, tilesY = (frame.height() + kTile - 1) / kTile;
  parallelFor(int64_t{tilesX} * tilesY, 1, [&](int64_t tile) {
    const int x0 = static_cast<int>(tile % tilesX) * kTile, y0 = static_cast<int>(tile / tilesX) * kTile;
    for (int y = y0; y < std::min(y0 + kTile, frame.height()); ++y)
      for (int x = x0; x < std::min(x0 + kTile, frame.width()) && !stop.stop_requested(); ++x) body(x, y);
  });
}

/// A ray through pixel (x, y) of the crop window, its place drawn from the film's filter.
inline CameraRay sampleCameraRay(const Scene& scene, int x, int y, Sampler& sampler) {
  const Vec2 offset = scene.filter.sample(sampler.next2D());
  return scene.camera.ray(static_cast<float>(x) + 0.5f + offset.x, static_cast<float>(y) + 0.5f + offset.y);
}

}  // namespace virga
