// SPDX-License-Identifier: Apache-2.0
// Compiled with -ffast-math (CMakeLists.txt), as frame_kernels.cpp.
#include "methods/instant_scattering/upsampling_kernels.h"

#include <algorithm>

namespace virga {

using Block = UpsamplingBlock;

void weighTaps(const Block& block, const UpsamplingTap* const taps[Block::kTaps], UpsamplingWeights& weights) {
  std::fill_n(weights.surfaceSum, Block::kPixels, 0.f);
  std::fill_n(weights.mediaSum, Block::kPixels, 0.f);
  for (int tap = 0; tap < Block::kTaps; ++tap) {
    kernels::weigh(block, *taps[tap], block.wx[tap % 4], block.wy[tap / 4], weights.surface[tap], weights.media[tap]);
    kernels::addScaled(block.count, weights.surfaceSum, weights.surface[tap], 1);
    kernels::addScaled(block.count, weights.mediaSum, weights.media[tap], 1);
  }
}

void spreadLight(const Block& block, const UpsamplingTap* const taps[Block::kTaps], const UpsamplingWeights& weights,
                 UpsampledLight& light) {
  light = {};
  alignas(64) Block::Lanes surfaceVeil[3] = {}, mediaVeil[3] = {};
  for (int tap = 0; tap < Block::kTaps; ++tap) {
    const UpsamplingTap& t = *taps[tap];
    for (int c = 0; c < 3; ++c) {
      kernels::addScaled(block.count, surfaceVeil[c], weights.surface[tap], t.surfaceVeil[c]);
      kernels::addScaled(block.count, mediaVeil[c], weights.media[tap], t.mediaVeil[c]);
      for (int l = 0; l < 2; ++l) {
        kernels::addScaled(block.count, light.surface[l][c], weights.surface[tap], t.surface[l][c]);
        kernels::addScaled(block.count, light.media[l][c], weights.media[tap], t.media[l][c]);
      }
    }
  }
  for (int c = 0; c < 3; ++c)
    for (int l = 0; l < 2; ++l) {
      kernels::unveil(block.count, light.surface[l][c], block.surfaceVeil[c], surfaceVeil[c]);
      kernels::unveil(block.count, light.media[l][c], block.mediaVeil[c], mediaVeil[c]);
    }
}

}  // namespace virga
