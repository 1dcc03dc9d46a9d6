// SPDX-License-Identifier: Apache-2.0
// Compiled with -ffast-math (CMakeLists.txt), as frame_kernels.cpp.
#include "methods/instant_scattering/upsampling_kernels.h"

namespace virga {

void weighTaps(const UpsamplingBlock& block, const UpsamplingTap* const taps[UpsamplingBlock::kTaps],
               UpsamplingWeights& weights) {
  kernels::weighTaps(block, taps, weights);
}

void spreadLight(const UpsamplingBlock& block, const UpsamplingTap* const taps[UpsamplingBlock::kTaps],
                 const UpsamplingWeights& weights, UpsampledLight& light) {
  kernels::spreadLight(block, taps, weights, light);
}

}  // namespace virga
