// SPDX-License-Identifier: Apache-2.0
// The plain loop that the frame's kernels are held against. Compiled with -ffast-math, as they are.
#include <cmath>

namespace virga {

/// Adds to `sum` the light of `count` isotropic lights in fog at a point. `light`: positions, then colours.
void plainGather(const float* const light[6], int count, float x, float y, float z, float sigmaT, float sum[3]);

void plainGather(const float* const light[6], int count, float x, float y, float z, float sigmaT, float sum[3]) {
  const float *px = light[0], *py = light[1], *pz = light[2], *cr = light[3], *cg = light[4], *cb = light[5];
  float r = 0, g = 0, b = 0;
#pragma omp simd reduction(+ : r, g, b)
  for (int i = 0; i < count; ++i) {
    const float dx = px[i] - x, dy = py[i] - y, dz = pz[i] - z;
    const float d2 = dx * dx + dy * dy + dz * dz;
    const float value = std::exp(-sigmaT * std::sqrt(d2)) * std::fmin(1 / d2, 25.f);
    r += value * cr[i];
    g += value * cg[i];
    b += value * cb[i];
  }
  sum[0] += r, sum[1] += g, sum[2] += b;
}

}  // namespace virga
