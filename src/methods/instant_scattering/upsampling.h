// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "core/parallel.h"
#include "image/image.h"
#include "image/layers.h"
#include "methods/instant_scattering/pixel_features.h"
#include "methods/instant_scattering/upsampling_kernels.h"

namespace virga {

/// Every n-th of the pixels along an edge of a picture, and the first or last one where the next would lie so near
/// behind the edge that it tells most of the pixels there.
class CoarseAxis {
 public:
  /// Of `size` pixels; `place` is that of a coarse one, or of any in step with it.
  CoarseAxis(int size, int spacing, int place);

  int count() const { return count_; }
  int at(int i) const { return std::clamp(cell(i), 0, size_ - 1); }
  /// Where the cell behind coarse pixel i begins; that of -1 lies before all of them.
  int cell(int i) const { return first_ + i * spacing_; }
  /// Number of the coarse pixel that x is, if it is one.
  std::optional<int> find(int x) const {
    const int i = (x - first_ + spacing_ / 2) / spacing_;
    return at(i) == x ? std::optional(i) : std::nullopt;
  }

 private:
  int size_, spacing_, first_, count_;
};

/// A picture's every n-th pixel in both directions, and how the others are made from them: by a cubic B-spline over
/// 4 x 4 of them, each weighted by how well its features agree (section 6 of the paper, where the filter is bilinear).
///
/// Light from surfaces and from media is filtered apart. Both are seen through something that the features know
/// exactly (reflectance and transmittance; opacity): the filter works on the light without it.
class Upsampling {
 public:
  /// What is seen by less than this share needs no care.
  static constexpr float kFaint = 2e-3f;

  struct Pixel {
    int x, y;
  };

  /// `features` of the whole picture, which must outlive it; `spacing` >= 1 pixels. `place` of a coarse pixel, or of
  /// any in step with it.
  Upsampling(std::span<const PixelFeatures> features, int width, int height, int spacing, Pixel place);

  /// The pixels to compute first, row by row.
  const std::vector<Pixel>& coarse() const { return coarse_; }

  /// Light of a pixel that was last scattered by a surface or in a medium, in two layers each: x2 a surface,
  /// x2 in a medium.
  struct Light {
    std::array<Rgb, 2> surface, media;

    void add(const LayerRadiance& radiance, float share) {
      for (size_t l = 0; l < 2; ++l) {
        surface[l] += radiance.value[static_cast<int>(kOnSurface[l])] * share;
        media[l] += radiance.value[static_cast<int>(kInMedia[l])] * share;
      }
    }
    /// add(layer, radiance).
    template <class Add>
    void visit(const Add& add) const {
      for (size_t l = 0; l < 2; ++l) add(kOnSurface[l], surface[l]);
      for (size_t l = 0; l < 2; ++l) add(kInMedia[l], media[l]);
    }
    static constexpr Layer kOnSurface[2] = {Layer::surfaceToSurface, Layer::mediaToSurface};
    static constexpr Layer kInMedia[2] = {Layer::surfaceToMedia, Layer::mediaToMedia};
  };

  /// body(x, y, light) for the pixels of the picture, in parallel and in any order, from the light of all coarse ones
  /// in their order. Returns the pixels that no coarse one agrees with, which must be computed as well. A stop leaves
  /// pixels out.
  template <class Body>
  std::vector<Pixel> spread(std::span<const Light> coarse, const std::stop_token& stop, const Body& body) const {
    const std::vector<UpsamplingTap> taps = tapsOf(coarse);
    std::vector<std::vector<Pixel>> others(static_cast<size_t>(blocksAcross_) * static_cast<size_t>(blocksDown_));
    parallelFor(static_cast<int64_t>(others.size()), 1, [&](int64_t n) {
      const PixelBlock block = blockOf(n);
      if (block.count == 0 || stop.stop_requested()) return;
      BlockLight light;
      lightBlock(block, taps, light);
      for (int i = 0; i < block.count; ++i) {
        const auto [x, y] = block.pixel[i];
        if (const auto own = irregularCoarse(x, y))
          body(x, y, coarse[*own]);
        else if (light.known[i])
          body(x, y, light.at(i));
        else
          others[static_cast<size_t>(n)].push_back({x, y});
      }
    });
    return joined(others);
  }

 private:
  /// Pixels between the same coarse ones.
  struct PixelBlock {
    int column, row;  ///< of the first of these
    int count = 0;
    Pixel pixel[UpsamplingBlock::kPixels];
  };
  struct BlockLight {
    UpsampledLight filtered;
    bool known[UpsamplingBlock::kPixels];  ///< a coarse pixel agrees

    Light at(int i) const {
      Light light;
      for (size_t l = 0; l < 2; ++l)
        for (int c = 0; c < 3; ++c)
          light.surface[l][c] = filtered.surface[l][c][i], light.media[l][c] = filtered.media[l][c][i];
      return light;
    }
  };

  PixelBlock blockOf(int64_t n) const;
  /// Weights of four coarse columns (or rows), by the pixel's place in the second one's cell.
  const std::array<float, 4>& splineAt(int place) const { return splines_[static_cast<size_t>(place)]; }
  /// Of the coarse pixels.
  std::vector<UpsamplingTap> tapsOf(std::span<const Light> light) const;
  struct Filter;
  void lightBlock(const PixelBlock& pixels, const std::vector<UpsamplingTap>& taps, BlockLight& light) const;
  static std::vector<Pixel> joined(const std::vector<std::vector<Pixel>>& lists);
  bool needsOwn(const PixelFeatures& features, float surfaceSum, float mediaSum) const;

  size_t numberOf(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }
  /// Its number, if it is a coarse pixel of which nothing can be said: its own light is taken.
  std::optional<size_t> irregularCoarse(int x, int y) const {
    if (features_[numberOf(x, y)].regular) return std::nullopt;
    const std::optional<int> i = columns_.find(x), j = rows_.find(y);
    if (!i || !j) return std::nullopt;
    return static_cast<size_t>(*j) * static_cast<size_t>(columns_.count()) + static_cast<size_t>(*i);
  }

  std::span<const PixelFeatures> features_;
  int width_, height_, spacing_;
  CoarseAxis columns_, rows_;
  int blocksPerCell_;  ///< in either direction
  int blocksAcross_, blocksDown_;
  std::vector<std::array<float, 4>> splines_;  ///< at each place between two coarse columns
  std::vector<Pixel> coarse_;
};

/// A place of coarse pixels in a pass: at the same pixels of the film whatever the crop window, and moved from pass to
/// pass, so that in the mean no pixel tells more of the picture than others.
Upsampling::Pixel coarsePlace(const PerspectiveCamera& camera, int spacing, uint32_t pass);

}  // namespace virga
