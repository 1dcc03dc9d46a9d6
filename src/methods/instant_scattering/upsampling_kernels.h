// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/host_device.h"
#include "methods/instant_scattering/frame_kernels.h"

namespace virga {

// The filter of Upsampling, for a block of pixels between the same coarse ones: plain loops over the pixels, compiled
// with -ffast-math. Nothing here may meet a NaN or an infinity.

/// What a coarse pixel sees, and its light.
struct UpsamplingTap {
  float px, py, pz, nx, ny, nz;  ///< surface and its normal
  float depth;                   ///< to it [unit]; 0: there is none
  float mediaDepth;              ///< PixelFeatures::mediaDepth
  float opacity;                 ///< mean of the channels
  float counts;                  ///< 1, or 0 where nothing can be said of it
  float surfaceVeil[3], mediaVeil[3];
  float surface[2][3], media[2][3];  ///< Upsampling::Light
};

struct UpsamplingBlock {
  static constexpr int kTaps = 16, kEdge = 8, kPixels = kEdge * kEdge;
  using Lanes = float[kPixels];

  int count = 0;                                                         ///< of pixels, rounded up to whole vectors
  alignas(64) Lanes px, py, pz, nx, ny, nz, depth, mediaDepth, opacity;  ///< as of a tap
  alignas(64) Lanes wx[4], wy[4];                                        ///< weights of the taps' columns and rows
  alignas(64) Lanes surfaceVeil[3], mediaVeil[3];
};

struct UpsamplingWeights {
  using Lanes = UpsamplingBlock::Lanes;
  alignas(64) Lanes surface[UpsamplingBlock::kTaps], media[UpsamplingBlock::kTaps];
  alignas(64) Lanes surfaceSum, mediaSum;
};

struct UpsampledLight {
  using Lanes = UpsamplingBlock::Lanes;
  alignas(64) Lanes surface[2][3], media[2][3];
};

/// Features that differ by so much (relative distances, cosines) agree by exp(-1/2).
inline constexpr float kDepthWidth = 0.05f, kNormalWidth = 0.1f, kMediaDepthWidth = 0.1f, kOpacityWidth = 0.3f;

namespace kernels {

VIRGA_HD static inline void weigh(const UpsamplingBlock& b, const UpsamplingTap& t, const float* __restrict wx,
                                  const float* __restrict wy, float* __restrict surface, float* __restrict media) {
#pragma omp simd
  for (int i = 0; i < b.count; ++i) {
    const float spline = wx[i] * wy[i] * t.counts;
    const float x = t.px - b.px[i], y = t.py - b.py[i], z = t.pz - b.pz[i];
    const float offHere = std::fabs(x * b.nx[i] + y * b.ny[i] + z * b.nz[i]);
    const float offThere = std::fabs(x * t.nx + y * t.ny + z * t.nz);
    const float nearest = std::fmin(b.depth[i], t.depth), leastMedia = std::fmin(b.mediaDepth[i], t.mediaDepth);
    const float off = std::fmax(offHere, offThere) / (kDepthWidth * nearest + 1e-30f);
    const float turned = (1 - (b.nx[i] * t.nx + b.ny[i] * t.ny + b.nz[i] * t.nz)) / kNormalWidth;
    const float apart = (b.mediaDepth[i] - t.mediaDepth) / (kMediaDepthWidth * leastMedia + 1e-30f);
    const float denser = (b.opacity[i] - t.opacity) / kOpacityWidth;
    const float s = falling(0.5f * (off * off + turned * turned));
    const float m = falling(0.5f * (apart * apart + denser * denser));
    surface[i] = nearest > 0 ? spline * s : 0.f;
    media[i] = leastMedia > 0 ? spline * m : 0.f;
  }
}

/// Adds weight * value.
VIRGA_HD static inline void addScaled(int count, float* __restrict sum, const float* __restrict weight, float value) {
#pragma omp simd
  for (int i = 0; i < count; ++i) sum[i] += weight[i] * value;
}

/// Sum of weight * light over the sum of weight * veil, seen through the pixels' own veil.
VIRGA_HD static inline void unveil(int count, float* __restrict light, const float* __restrict own,
                                   const float* __restrict through) {
#pragma omp simd
  for (int i = 0; i < count; ++i) light[i] = through[i] > 1e-30f ? light[i] * own[i] / through[i] : 0.f;
}

/// How well each tap's features agree with each pixel's, times the spline.
VIRGA_HD static inline void weighTaps(const UpsamplingBlock& block,
                                      const UpsamplingTap* const taps[UpsamplingBlock::kTaps],
                                      UpsamplingWeights& weights) {
  for (int i = 0; i < UpsamplingBlock::kPixels; ++i) weights.surfaceSum[i] = weights.mediaSum[i] = 0;
  for (int tap = 0; tap < UpsamplingBlock::kTaps; ++tap) {
    weigh(block, *taps[tap], block.wx[tap % 4], block.wy[tap / 4], weights.surface[tap], weights.media[tap]);
    addScaled(block.count, weights.surfaceSum, weights.surface[tap], 1);
    addScaled(block.count, weights.mediaSum, weights.media[tap], 1);
  }
}

/// The light of the taps in each pixel.
VIRGA_HD static inline void spreadLight(const UpsamplingBlock& block,
                                        const UpsamplingTap* const taps[UpsamplingBlock::kTaps],
                                        const UpsamplingWeights& weights, UpsampledLight& light) {
  light = {};
  alignas(64) UpsamplingBlock::Lanes surfaceVeil[3] = {}, mediaVeil[3] = {};
  for (int tap = 0; tap < UpsamplingBlock::kTaps; ++tap) {
    const UpsamplingTap& t = *taps[tap];
    for (int c = 0; c < 3; ++c) {
      addScaled(block.count, surfaceVeil[c], weights.surface[tap], t.surfaceVeil[c]);
      addScaled(block.count, mediaVeil[c], weights.media[tap], t.mediaVeil[c]);
      for (int l = 0; l < 2; ++l) {
        addScaled(block.count, light.surface[l][c], weights.surface[tap], t.surface[l][c]);
        addScaled(block.count, light.media[l][c], weights.media[tap], t.media[l][c]);
      }
    }
  }
  for (int c = 0; c < 3; ++c)
    for (int l = 0; l < 2; ++l) {
      unveil(block.count, light.surface[l][c], block.surfaceVeil[c], surfaceVeil[c]);
      unveil(block.count, light.media[l][c], block.mediaVeil[c], mediaVeil[c]);
    }
}

}  // namespace kernels

// --- to be called; defined in upsampling_kernels.cpp ---

/// kernels::weighTaps.
void weighTaps(const UpsamplingBlock& block, const UpsamplingTap* const taps[UpsamplingBlock::kTaps],
               UpsamplingWeights& weights);
/// kernels::spreadLight.
void spreadLight(const UpsamplingBlock& block, const UpsamplingTap* const taps[UpsamplingBlock::kTaps],
                 const UpsamplingWeights& weights, UpsampledLight& light);

}  // namespace virga
