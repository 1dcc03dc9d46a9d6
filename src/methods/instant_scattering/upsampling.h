// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "image/image.h"
#include "image/layers.h"
#include "methods/instant_scattering/pixel_features.h"

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
  /// The light in pixel (x, y), from that of all computed pixels, in their order.
  Light at(const std::vector<Light>& computed, int x, int y) const;

 private:
  static constexpr int kTaps = 4;
  static constexpr uint32_t kFiltered = ~0u;

  struct Weights {
    float surface[kTaps * kTaps], media[kTaps * kTaps];
    float surfaceSum = 0, mediaSum = 0;
  };
  /// The coarse pixels around one: the first column and row, and their weights by distance alone.
  struct Place {
    int i, j;
    std::array<float, kTaps> wx, wy;
  };
  Place placeOf(int x, int y) const;
  void addTap(const PixelFeatures& here, const Place& place, int tap, Weights& w) const;
  const PixelFeatures& features(int x, int y) const {
    return features_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  }
  int coarseIndex(int i, int j) const;  ///< clamped to the picture
  bool needsOwn(int x, int y) const;

  std::vector<PixelFeatures> features_;
  int width_, height_, spacing_;
  int columns_, rows_;  ///< of coarse pixels
  std::vector<Pixel> computed_;
  std::vector<uint32_t> own_;  ///< of each pixel: its place among the computed ones, or kFiltered
};

}  // namespace virga
