// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <span>
#include <stop_token>
#include <vector>

#include "image/layers.h"
#include "methods/instant_scattering/eye_packet.h"
#include "methods/instant_scattering/pixel_features.h"
#include "methods/pixels.h"

namespace virga {

/// Neighbouring eye rays, what they meet, and the media that they pass: side by side where all is one smoke. Large;
/// meant to be used again.
class EyeBlock {
 public:
  static constexpr int kSize = EyePacket::kSize;

  struct Pixel {
    int x, y;
  };
  std::array<Pixel, kSize> pixels;
  size_t count = 0;                           ///< of them
  std::array<LayerRadiance, kSize> radiance;  ///< room for what is found of each

  /// Marches the ray startOf(pixel) of each pixel, by so many steps through each stretch of media. `packs`: smoke may
  /// be left to smoke(): then it is in no step of an eye, but is its first medium and in its optical depth.
  template <class StartOf>
  void look(const SceneView& scene, const EmbreeRays& rays, int steps, bool packs, const StartOf& startOf) {
    std::array<EyeStart, kSize> starts;
    for (size_t i = 0; i < count; ++i) starts[i] = startOf(pixels[i]);
    march(scene, rays, steps, packs, std::span(starts).first(count));
  }

  std::span<const MarchedEye> eyes() const { return std::span(eyes_).first(count); }
  const EyePacket& smoke() const { return smoke_; }
  PixelFeatures features(size_t i) const {
    return smoke_.has(i) ? pixelFeatures(eyes_[i], smoke_.meanPlace(i)) : pixelFeatures(eyes_[i]);
  }

 private:
  void march(const SceneView& scene, const EmbreeRays& rays, int steps, bool packs, std::span<const EyeStart> starts);
  /// Fills eye number i, or leaves its media to the packet.
  void meet(const SceneView& scene, const EmbreeRays& rays, int steps, bool packs, size_t i, const EyeStart& start,
            const RayHit& hit);

  std::vector<MarchedEye> eyes_ = std::vector<MarchedEye>(kSize);
  EyePacket smoke_;
};

/// body(block) for the pixels of the frame, a block of them at a time, on all threads. Returns early when it shall
/// stop.
template <class Body>
void forEachBlock(const PassFrame& frame, const std::stop_token& stop, const Body& body) {
  constexpr int kEdge = 4;
  static_assert(kEdge * kEdge == EyeBlock::kSize);
  const int across = (frame.width() + kEdge - 1) / kEdge, down = (frame.height() + kEdge - 1) / kEdge;
  tbb::enumerable_thread_specific<EyeBlock> blocks;
  parallelFor(down, 1, [&](int64_t row) {
    EyeBlock& block = blocks.local();
    for (int i = 0; i < across && !stop.stop_requested(); ++i) {
      block.count = 0;
      const int x0 = i * kEdge, y0 = static_cast<int>(row) * kEdge;
      for (int y = y0; y < std::min(y0 + kEdge, frame.height()); ++y)
        for (int x = x0; x < std::min(x0 + kEdge, frame.width()); ++x) block.pixels[block.count++] = {x, y};
      body(block);
    }
  });
}

}  // namespace virga
