// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "methods/instant_scattering/lamp_kernels.h"

namespace virga {

// Neighbouring eye rays, each through one stretch of the same grid, are marched side by side: plain loops
// over arrays, as in frame_kernels.h, and compiled likewise.

/// Values on a box of voxels, x fastest; fewer than 2^31 of them.
struct KernelGrid {
  const float* values = nullptr;
  int nx = 0, ny = 0, nz = 0;
};

/// What is marched. Step n of a ray goes from n - shift to n + 1 - shift steps behind its begin, and is cut where it
/// reaches beyond begin or end.
struct KernelEyes {
  static constexpr int kSize = RayPacket::kSize;
  using Lanes = float[kSize];

  alignas(64) Lanes ox, oy, oz, dx, dy, dz;   ///< the rays in the world
  alignas(64) Lanes gx, gy, gz, hx, hy, hz;   ///< middle of step 0 and one step, in voxels of the grid
  alignas(64) Lanes begin, end, step;         ///< along the ray [unit]
  alignas(64) Lanes shift;                    ///< in [0, 1)
  alignas(64) int first[kSize], last[kSize];  ///< the steps that may hold something; none where first > last
  int from = 0, to = -1;                      ///< of all rays
  float sigmaT = 0;                           ///< of density 1 in the densest channel [1/unit]
  float spectrum[3] = {1, 1, 1};              ///< of the channels, relative to it
  float thick = 0;                            ///< optical depth in that channel behind which nothing counts
};

/// Optical depths of the densest channel along these rays, and what follows from them.
struct KernelDepths {
  static constexpr int kMostSteps = 129;
  using Lanes = KernelEyes::Lanes;

  alignas(64) Lanes before[kMostSteps + 1];  ///< each step; valid from KernelEyes::from to KernelEyes::to + 1
  alignas(64) Lanes total;
  alignas(64) Lanes opacity;    ///< by the mean of the channels
  alignas(64) Lanes meanPlace;  ///< along the ray, of what is seen of the medium, likewise [unit]; 0: nothing is
};

/// A point of each ray, and the medium there: sigma_t tau over the density with which the point was chosen.
struct EyePoints : KernelPlaces {
  alignas(64) float weight[3][RayPacket::kSize];
};

namespace kernels {

VIRGA_HD static inline float clamped(float x, float most) { return x > 0 ? (x < most ? x : most) : 0; }

VIRGA_HD static inline float meanOf(const float* channels) { return (channels[0] + channels[1] + channels[2]) / 3; }

/// Densities at step n of all rays: lookupAlong(), of one place of each ray in place of many along one.
VIRGA_HD static inline void densitiesAt(const KernelGrid& grid, const KernelEyes& e, float n,
                                        float* __restrict density) {
  const float* __restrict values = grid.values;
  const auto mostX = static_cast<float>(grid.nx - 1), mostY = static_cast<float>(grid.ny - 1),
             mostZ = static_cast<float>(grid.nz - 1);
  const int row = grid.nx, slice = grid.nx * grid.ny;
  const int lastX = grid.nx - 1, lastY = grid.ny - 1, lastZ = grid.nz - 1;
#pragma omp simd
  for (int i = 0; i < KernelEyes::kSize; ++i) {
    const float x = clamped(e.gx[i] + n * e.hx[i], mostX), y = clamped(e.gy[i] + n * e.hy[i], mostY),
                z = clamped(e.gz[i] + n * e.hz[i], mostZ);
    const int u = static_cast<int>(x), v = static_cast<int>(y), w = static_cast<int>(z);
    const float fx = x - static_cast<float>(u), fy = y - static_cast<float>(v), fz = z - static_cast<float>(w);
    const int dx = u < lastX ? 1 : 0, dy = v < lastY ? row : 0, dz = w < lastZ ? slice : 0;
    const int at = w * slice + v * row + u;
    const float c00 = values[at] + (values[at + dx] - values[at]) * fx;
    const float c10 = values[at + dy] + (values[at + dy + dx] - values[at + dy]) * fx;
    const float c01 = values[at + dz] + (values[at + dz + dx] - values[at + dz]) * fx;
    const float c11 = values[at + dz + dy] + (values[at + dz + dy + dx] - values[at + dz + dy]) * fx;
    const float c0 = c00 + (c10 - c00) * fy, c1 = c01 + (c11 - c01) * fy;
    density[i] = c0 + (c1 - c0) * fz;
  }
}

/// Marches all rays to their ends, or until nothing behind counts; then `e.to` becomes the step at which they stopped.
VIRGA_HD static inline void march(const KernelGrid& grid, KernelEyes& e, KernelDepths& d) {
  constexpr int kSize = KernelEyes::kSize;
  const float mean = meanOf(e.spectrum);
  alignas(64) float passed[kSize], moment[kSize], density[kSize];
  for (int i = 0; i < kSize; ++i) d.total[i] = moment[i] = 0, passed[i] = 1;
  for (int n = e.from; n <= e.to; ++n) {
    float* __restrict before = d.before[n];
    int marching = 0;
    densitiesAt(grid, e, static_cast<float>(n), density);
#pragma omp simd reduction(+ : marching)
    for (int i = 0; i < kSize; ++i) {
      const float near = std::fmax(static_cast<float>(n) - e.shift[i], 0.f);
      const float far = static_cast<float>(n + 1) - e.shift[i];
      const float a = e.begin[i] + e.step[i] * near, b = std::fmin(e.begin[i] + e.step[i] * far, e.end[i]);
      const bool within = (n >= e.first[i]) & (n <= e.last[i]) & (d.total[i] <= e.thick);
      const float own = within ? e.sigmaT * density[i] * std::fmax(b - a, 0.f) : 0.f;
      before[i] = d.total[i];
      const float depth = before[i] + own, after = falling(mean * depth), seen = passed[i] - after;
      // Mean of t in [0, 1] by exp(-m t): 1 / m - 1 / (exp(m) - 1), or its series up to an error of 4e-5.
      const float m = mean * own;
      const float series = 0.5f - m / 12 + m * m * m / 720, exact = 1 / (m + 1e-20f) - after / (seen + 1e-20f);
      moment[i] += seen * (a + (b - a) * (m > 1 ? exact : series));
      d.total[i] = depth;
      passed[i] = after;
      marching += (n < e.last[i]) & (depth <= e.thick) ? 1 : 0;
    }
    if (marching == 0) e.to = n;
  }
  for (int i = 0; i < kSize; ++i) {
    d.before[e.to + 1][i] = d.total[i];
    d.opacity[i] = 1 - passed[i];
    d.meanPlace[i] = d.opacity[i] > 0 ? moment[i] / (d.opacity[i] + 1e-20f) : 0.f;
  }
}

/// Points at the share `place` in [0, 1) of what is seen of the medium, one for each ray: as MarchedEye::visitPoints().
VIRGA_HD static inline void pointsAt(const KernelEyes& e, const KernelDepths& d, const float* __restrict place,
                                     EyePoints& __restrict at) {
  constexpr int kSize = KernelEyes::kSize;
  const float mean = meanOf(e.spectrum);
  alignas(64) float reached[kSize];
  alignas(64) int index[kSize];
#pragma omp simd
  for (int i = 0; i < kSize; ++i) reached[i] = -std::log(1 - d.opacity[i] * place[i]) / mean, index[i] = e.from;
  for (int n = e.from; n < e.to; ++n) {
    const float* __restrict after = d.before[n + 1];
#pragma omp simd
    for (int i = 0; i < kSize; ++i) index[i] += after[i] <= reached[i] ? 1 : 0;
  }
#pragma omp simd
  for (int i = 0; i < kSize; ++i) {
    const int n = index[i];
    const float before = d.before[n][i], own = d.before[n + 1][i] - before;
    const float here = clamped((reached[i] - before) / (own + 1e-20f), 1);
    const float a = e.begin[i] + e.step[i] * std::fmax(static_cast<float>(n) - e.shift[i], 0.f);
    const float b = std::fmin(e.begin[i] + e.step[i] * (static_cast<float>(n + 1) - e.shift[i]), e.end[i]);
    const float t = a + (b - a) * here, depth = before + own * here;
    at.px[i] = e.ox[i] + e.dx[i] * t, at.py[i] = e.oy[i] + e.dy[i] * t, at.pz[i] = e.oz[i] + e.dz[i] * t;
    // The density is that of the mean channel.
    for (int c = 0; c < 3; ++c)
      at.weight[c][i] = e.spectrum[c] / mean * d.opacity[i] * std::exp((mean - e.spectrum[c]) * depth);
  }
}

/// Optical depths of the densest channel along ray number `lane`, at `count` places. Its steps were not shifted.
VIRGA_HD static inline void depthsAlong(const KernelEyes& e, const KernelDepths& d, int lane, const float* places,
                                        int count, float* __restrict out) {
  const float* __restrict before = d.before[0] + lane;
  const float begin = e.begin[lane], inverse = 1 / e.step[lane];
  const auto from = static_cast<float>(e.from), to = static_cast<float>(e.to);
#pragma omp simd
  for (int m = 0; m < count; ++m) {
    const float step = (places[m] - begin) * inverse, in = step < from ? from : (step < to ? step : to);
    const int n = static_cast<int>(in);
    const float share = clamped(step - static_cast<float>(n), 1);
    const float a = before[n * KernelEyes::kSize], b = before[(n + 1) * KernelEyes::kSize];
    out[m] = a + (b - a) * share;
  }
}

/// What media scatter of a lamp's light toward the eyes at a point of each: Henyey and Greenstein's phase function of
/// `anisotropy` over distance squared [1/(sr unit^2)].
VIRGA_HD static inline void lampAtPoints(const LampPoint& lamp, const KernelEyes& e, const KernelPlaces& at,
                                         float anisotropy, float* __restrict value) {
  const float g = anisotropy;
#pragma omp simd
  for (int i = 0; i < KernelEyes::kSize; ++i) {
    const float x = at.px[i] - lamp.px, y = at.py[i] - lamp.py, z = at.pz[i] - lamp.pz;
    const float d2 = x * x + y * y + z * z + 1e-20f, inverse = 1 / std::sqrt(d2);
    const float toward = (e.dx[i] * x + e.dy[i] * y + e.dz[i] * z) * inverse;  // dot(wo, wi)
    const float q = 1 + g * g + 2 * g * toward;
    value[i] = kInverse4Pi * (1 - g * g) / (q * std::sqrt(q)) * lampCosine(lamp, x, y, z, inverse) / d2;
  }
}

}  // namespace kernels

// --- to be called; defined in frame_kernels.cpp ---

/// kernels::march.
void marchEyes(const KernelGrid& grid, KernelEyes& eyes, KernelDepths& depths);
/// kernels::pointsAt.
void placePoints(const KernelEyes& eyes, const KernelDepths& depths, const float* place, EyePoints& at);
/// kernels::depthsAlong.
void lookUpDepths(const KernelEyes& eyes, const KernelDepths& depths, int lane, const float* places, int count,
                  float* out);
/// kernels::lampAtPoints where `at` weighs anything, and the rays.
void lightEyes(const LampPoint& lamp, const KernelEyes& eyes, const EyePoints& at, float anisotropy, float scale,
               float* value, RayPacket& rays);

}  // namespace virga
