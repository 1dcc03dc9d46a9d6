// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "image/image.h"
#include "image/layers.h"

namespace virga {

/// What one pass writes: a beauty plane and a plane for each requested layer. Pixels are independent: different threads
/// may set different pixels at once.
class PassFrame {
 public:
  PassFrame(int width, int height, LayerMask layers);

  int width() const { return width_; }
  int height() const { return height_; }
  LayerMask layers() const { return layers_; }
  /// Sets the pixel's value of this pass (a mean over the pass's samples in that pixel), in every plane.
  void set(int x, int y, const LayerRadiance& radiance);
  /// Adds to a pixel that this pass has set.
  void add(int x, int y, Layer layer, Rgb radiance);

 private:
  friend class Film;
  int width_, height_;
  LayerMask layers_;
  /// [0] beauty (empty where all layers are there), then the layers of the mask in the order of the enum
  std::vector<Image> planes_;
};

/// The layered picture: for each plane the running mean (Welford) of R independent replicates, filled in turn. The
/// spread *between replicates* is the picture's variance; passes within a replicate share a low-discrepancy sequence
/// and say nothing about it.
///
/// Where all layers are stored, the beauty is their sum in the order of the enum, bit for bit, per replicate and in the
/// mean.
class Film {
 public:
  static constexpr int kReplicates = 8;

  Film(int width, int height, LayerMask layers);

  int width() const;
  int height() const;
  LayerMask layers() const;

  /// The frame for the next pass to fill, every pixel of it: what a pass before has left is still in there. Nothing
  /// counts until average() or replace(), so an aborted pass leaves no trace.
  PassFrame& frame() { return frame_; }
  /// The frame is one more sample of `replicate` in [0, kReplicates).
  void average(int replicate);
  /// The frame is the whole picture now, as one pass of replicate 0; what was averaged before is forgotten.
  void replace();
  void clear();

  int64_t passes() const;  ///< averaged or replaced since the last clear()
  int64_t passesOf(int replicate) const;
  /// Pixels that were NaN or infinite in any plane when they came, summed over the passes that are in the picture. They
  /// stay in it: a mean with a NaN is NaN.
  uint64_t nonFiniteSamples() const;

  Image beauty() const;
  Image layer(Layer) const;  ///< programmer error if the layer was not requested
  Image replicateBeauty(int replicate) const;
  Image replicateLayer(int replicate, Layer) const;

  /// At least two replicates hold a pass.
  bool hasVariance() const;
  Image beautyVariance() const;      ///< of the mean, per pixel and channel; programmer error without hasVariance()
  Image layerVariance(Layer) const;  ///< likewise
  /// Expected relMSE of the beauty: mean over pixels and channels of variance / (mean^2 + 0.01), each replicate's share
  /// in the variance over the mean of the *others*. Pixels that are not finite are left out (nonFiniteSamples() tells
  /// of them); nothing without hasVariance() or without a finite pixel.
  std::optional<double> estimatedRelMse() const;

 private:
  struct Replicate {
    int64_t passes = 0;
    std::vector<Image> planes;  ///< running means, as in PassFrame; allocated by the first pass
  };
  struct Weighted {
    const Replicate* replicate;
    double weight;
  };
  struct Moments {
    double mean[3], variance[3];
    double relativeVariance[3];  ///< over mean^2 + 0.01
  };

  uint64_t countNonFinite(size_t begin, size_t end) const;
  uint64_t mergeChunk(Replicate&, size_t begin, size_t end) const;
  uint64_t merge(Replicate&);
  bool storesBeauty() const;
  size_t planeOf(Layer) const;
  Image replicatePlane(int replicate, size_t plane) const;
  Image planeMean(size_t plane) const;
  std::vector<Weighted> weighted() const;
  template <class Value>
  static Moments moments(const std::vector<Weighted>& filled, const Value& value);
  static Rgb beautyAt(const Replicate&, size_t pixel);
  template <class Value>
  Image varianceOf(const Value& value) const;

  PassFrame frame_;
  std::array<Replicate, kReplicates> replicates_;
  int64_t passes_ = 0;
  uint64_t nonFinite_ = 0;
};

}  // namespace virga
