// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "image/image.h"
#include "image/layers.h"

namespace virga {

/// What one pass writes: a beauty plane and a plane for each requested layer. Pixels are independent: different threads may
/// set different pixels at once.
class PassFrame {
 public:
  PassFrame(int width, int height, LayerMask layers);

  int width() const { return width_; }
  int height() const { return height_; }
  LayerMask layers() const { return layers_; }
  /// Sets the pixel's value of this pass (a mean over the pass's samples in that pixel), in every plane.
  void set(int x, int y, const LayerRadiance& radiance);

 private:
  friend class Film;
  int width_, height_;
  LayerMask layers_;
  std::vector<Image> planes_;  ///< [0] beauty, then the layers of the mask in the order of the enum
};

/// The layered picture: for each plane the running mean (Welford) of R independent replicates, filled in turn. The spread
/// *between replicates* is the picture's variance; passes within a replicate share a low-discrepancy sequence and say
/// nothing about it.
///
/// Where all layers are stored, the beauty is their sum in the order of the enum, bit for bit, per replicate and in the mean.
class Film {
 public:
  static constexpr int kReplicates = 8;

  Film(int width, int height, LayerMask layers);

  int width() const;
  int height() const;
  LayerMask layers() const;

  /// The frame for the next pass to fill. Nothing counts until average() or replace().
  PassFrame& frame() { return frame_; }
  /// The frame is one more sample of `replicate` in [0, kReplicates).
  void average(int replicate);
  /// The frame is the whole picture now; what was averaged before is forgotten.
  void replace();
  void clear();

  int64_t passes() const;  ///< averaged or replaced since the last clear()
  int64_t passesOf(int replicate) const;
  uint64_t nonFiniteSamples() const;  ///< pixel values that were NaN or infinite when they came; they stay in the picture

  Image beauty() const;
  Image layer(Layer) const;  ///< programmer error if the layer was not requested
  Image replicateBeauty(int replicate) const;
  Image replicateLayer(int replicate, Layer) const;

  /// At least two replicates hold a pass.
  bool hasVariance() const;
  Image beautyVariance() const;      ///< of the mean, per pixel and channel; programmer error without hasVariance()
  Image layerVariance(Layer) const;  ///< likewise
  /// Expected relMSE of the beauty: mean over pixels and channels of variance / (mean^2 + 0.01).
  std::optional<double> estimatedRelMse() const;

 private:
  PassFrame frame_;
  // the rest is for the implementation to choose
};

}  // namespace virga
