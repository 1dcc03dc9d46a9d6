// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <stop_token>
#include <vector>

#include "core/parallel.h"
#include "image/image.h"
#include "image/layers.h"
#include "methods/instant_scattering/pixel_features.h"
#include "methods/instant_scattering/upsampling_kernels.h"

namespace virga {

/// A picture's every n-th pixel in both directions, and how the others are made from them: by a cubic B-spline over
/// 4 x 4 of them, each weighted by how well its features agree (section 6 of the paper, where the filter is bilinear).
///
/// Light from surfaces and from media is filtered apart. Both are seen through something that the features know
/// exactly (reflectance and transmittance; opacity): the filter works on the light without it.
class Upsampling {
 public:
  /// Of the whole picture; `spacing` >= 1 pixels.
  Upsampling(std::vector<PixelFeatures> features, int width, int height, int spacing);

  struct Pixel {
    int x, y;
  };
  /// The pixels to compute, coarse ones row by row, then those that no coarse one agrees with.
  const std::vector<Pixel>& computed() const { return computed_; }

  /// Light of a computed pixel that was last scattered by a surface or in a medium, in two layers each: x2 a surface,
  /// x2 in a medium.
  struct Light {
    std::array<Rgb, 2> surface, media;

    void add(const LayerRadiance& radiance, float share) {
      for (size_t l = 0; l < 2; ++l) {
        surface[l] += radiance.value[static_cast<int>(kOnSurface[l])] * share;
        media[l] += radiance.value[static_cast<int>(kInMedia[l])] * share;
      }
    }
    void addTo(LayerRadiance& radiance) const {
      for (size_t l = 0; l < 2; ++l) radiance.add(kOnSurface[l], surface[l]), radiance.add(kInMedia[l], media[l]);
    }
    static constexpr Layer kOnSurface[2] = {Layer::surfaceToSurface, Layer::mediaToSurface};
    static constexpr Layer kInMedia[2] = {Layer::surfaceToMedia, Layer::mediaToMedia};
  };

  /// body(x, y, light) for every pixel of the picture, in parallel and in any order, from the light of all computed
  /// pixels in their order. A stop leaves pixels out.
  template <class Body>
  void spread(const std::vector<Light>& computed, const std::stop_token& stop, const Body& body) const {
    const std::vector<UpsamplingTap> taps = tapsOf(&computed);
    parallelFor(int64_t{blocksAcross_} * blocksDown_, 1, [&](int64_t n) {
      const PixelBlock block = blockOf(n);
      if (block.count == 0 || stop.stop_requested()) return;
      const BlockLight light = lightOf(block, taps);
      for (int i = 0; i < block.count && !stop.stop_requested(); ++i) {
        const auto [x, y] = block.pixel[i];
        body(x, y, light.at(i, computed, ownOf(x, y)));
      }
    });
  }

 private:
  static constexpr uint32_t kFiltered = ~0u;  ///< a pixel that is not computed, or that is filtered all the same

  /// Pixels between the same coarse ones.
  struct PixelBlock {
    int column, row;  ///< of the first of these
    int count = 0;
    Pixel pixel[UpsamplingBlock::kPixels];
  };
  struct BlockLight {
    UpsampledLight filtered;

    Light at(int i, const std::vector<Light>& computed, uint32_t own) const {
      if (own != kFiltered) return computed[own];
      Light light;
      for (size_t l = 0; l < 2; ++l)
        for (int c = 0; c < 3; ++c)
          light.surface[l][c] = filtered.surface[l][c][i], light.media[l][c] = filtered.media[l][c][i];
      return light;
    }
  };

  PixelBlock blockOf(int64_t n) const;
  /// Weights of four coarse columns (or rows), a pixel's place counted from the start of the second one's cell.
  const std::array<float, 4>& splineAt(int place) const;
  /// Of the coarse pixels; without light if there is none yet.
  std::vector<UpsamplingTap> tapsOf(const std::vector<Light>* light) const;
  struct Filter;
  BlockLight lightOf(const PixelBlock& pixels, const std::vector<UpsamplingTap>& taps) const;
  bool needsOwn(const PixelFeatures& features, float surfaceSum, float mediaSum) const;

  size_t numberOf(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }
  /// The number of its own light, if that is to be taken.
  uint32_t ownOf(int x, int y) const {
    const uint32_t own = own_[numberOf(x, y)];
    const bool coarse = own < static_cast<uint32_t>(columns_ * rows_);
    return coarse && features_[numberOf(x, y)].regular ? kFiltered : own;
  }

  std::vector<PixelFeatures> features_;
  int width_, height_, spacing_;
  int columns_, rows_;  ///< of coarse pixels
  int blocksPerCell_;   ///< in either direction
  int blocksAcross_, blocksDown_;
  std::vector<std::array<float, 4>> splines_;  ///< at each place between two coarse columns
  std::vector<Pixel> computed_;
  std::vector<uint32_t> own_;  ///< of each pixel: its place among the computed ones, or kFiltered
};

}  // namespace virga
