// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/host_device.h"
#include "methods/instant_scattering/frame_kernels.h"
#include "rays/ray_packet.h"

namespace virga {

// Lamps of a frame light a packet of neighbouring pixels: plain loops over arrays, as in frame_kernels.h, and compiled
// likewise.

/// A fixed point of a lamp.
struct LampPoint {
  bool known = false;  ///< there is one
  float px = 0, py = 0, pz = 0;
  float nx = 0, ny = 0, nz = 0;  ///< normal; 0 where it sends to all sides alike
  float all = 0;                 ///< 1 where it does, otherwise 0
  float r = 0, g = 0, b = 0;     ///< intensity along the normal, over how many points there are [W/sr]
  float area = 0;                ///< of the whole lamp [unit^2]; 0 if it has none
};

/// Places in media.
struct KernelPlaces {
  alignas(64) float px[RayPacket::kSize], py[RayPacket::kSize], pz[RayPacket::kSize];
};

/// Places on surfaces; both normals are on the side that the eye sees. Those with epsilon < 0 are not there.
struct KernelSurfaces : KernelPlaces {
  alignas(64) float nx[RayPacket::kSize], ny[RayPacket::kSize], nz[RayPacket::kSize];  ///< shading normal
  alignas(64) float gx[RayPacket::kSize], gy[RayPacket::kSize], gz[RayPacket::kSize];  ///< geometric
  alignas(64) float epsilon[RayPacket::kSize];  ///< how far off the surface rays start [unit]
};

/// Rays through one homogeneous medium each, from t0 to t1. Those with t1 <= t0 are not there.
struct FogRays {
  alignas(64) float ox[RayPacket::kSize], oy[RayPacket::kSize], oz[RayPacket::kSize];
  alignas(64) float dx[RayPacket::kSize], dy[RayPacket::kSize], dz[RayPacket::kSize];
  alignas(64) float t0[RayPacket::kSize], t1[RayPacket::kSize];  ///< [unit]
  alignas(64) float sigmaT[3][RayPacket::kSize];                 ///< [1/unit]
  alignas(64) float anisotropy[RayPacket::kSize];                ///< g
};

namespace kernels {

/// atan2 of y >= 0 (Abramowitz and Stegun 1964, 4.4.49: error 1e-5), and sine and cosine of an angle in [0, pi] by
/// their series about pi / 2 (4e-6): the compiler has no vector code for those of the library.
VIRGA_HD static inline float angleOf(float y, float x) {
  const float ax = std::fabs(x), least = y < ax ? y : ax, most = y < ax ? ax : y;
  const float q = least / (most + 1e-30f), q2 = q * q;
  const float a = q * (0.9998660f + q2 * (-0.3302995f + q2 * (0.1801410f + q2 * (-0.0851330f + q2 * 0.0208351f))));
  const float upper = y < ax ? a : 1.5707963f - a;
  return x < 0 ? 3.1415927f - upper : upper;
}
VIRGA_HD static inline float sineOf(float angle) {
  const float x = angle - 1.5707963f, x2 = x * x;
  return 1 - x2 * (0.5f - x2 * (1 / 24.f - x2 * (1 / 720.f - x2 * (1 / 40320.f - x2 / 3628800.f))));
}
VIRGA_HD static inline float cosineOf(float angle) {
  const float x = angle - 1.5707963f, x2 = x * x;
  return -x * (1 - x2 * (1 / 6.f - x2 * (1 / 120.f - x2 * (1 / 5040.f - x2 / 362880.f))));
}

/// What the lamp sends toward a place at (x, y, z) from it, `inverse` over that distance; over its intensity.
VIRGA_HD static inline float lampCosine(const LampPoint& lamp, float x, float y, float z, float inverse) {
  return lamp.all + std::fmax(0.f, (lamp.nx * x + lamp.ny * y + lamp.nz * z) * inverse);
}

/// Light of a lamp at surfaces: cosines over distance squared [1/unit^2].
VIRGA_HD static inline void lampOnSurfaces(const LampPoint& lamp, const KernelSurfaces& s, float* __restrict value) {
#pragma omp simd
  for (int i = 0; i < RayPacket::kSize; ++i) {
    const float x = lamp.px - s.px[i], y = lamp.py - s.py[i], z = lamp.pz - s.pz[i];
    const float d2 = x * x + y * y + z * z + 1e-20f, inverse = 1 / std::sqrt(d2);
    const float cosine = (s.nx[i] * x + s.ny[i] * y + s.nz[i] * z) * inverse;
    const float above = s.gx[i] * x + s.gy[i] * y + s.gz[i] * z;
    const bool lit = (cosine > 0) & (above > 0) & (s.epsilon[i] >= 0);
    value[i] = lit ? cosine * lampCosine(lamp, -x, -y, -z, inverse) / d2 : 0.f;
  }
}

/// Likewise in media: [1/unit^2] without a cosine.
VIRGA_HD static inline void lampInMedia(const LampPoint& lamp, const KernelPlaces& s, float* __restrict value) {
#pragma omp simd
  for (int i = 0; i < RayPacket::kSize; ++i) {
    const float x = s.px[i] - lamp.px, y = s.py[i] - lamp.py, z = s.pz[i] - lamp.pz;
    const float d2 = x * x + y * y + z * z + 1e-20f;
    value[i] = lampCosine(lamp, x, y, z, 1 / std::sqrt(d2)) / d2;
  }
}

/// Where a lamp lights rays through fog, and what that adds for each channel, but for albedo, intensity, visibility and
/// the transmittance from the lamp: at the share `place` of the angle that the ray fills as seen from the lamp (Kulla
/// and Fajardo 2012). `value` is the light of a lamp that sends 1 W/sr along its normal.
VIRGA_HD static inline void lampInFog(const LampPoint& lamp, const FogRays& ray, float place, KernelPlaces& at,
                                      float (*__restrict value)[RayPacket::kSize]) {
#pragma omp simd
  for (int i = 0; i < RayPacket::kSize; ++i) {
    const float x = lamp.px - ray.ox[i], y = lamp.py - ray.oy[i], z = lamp.pz - ray.oz[i];
    const float foot = x * ray.dx[i] + y * ray.dy[i] + z * ray.dz[i];
    const float ex = x - ray.dx[i] * foot, ey = y - ray.dy[i] * foot, ez = z - ray.dz[i] * foot;
    const float height = std::sqrt(ex * ex + ey * ey + ez * ez) + 1e-4f * std::fabs(foot) + 1e-12f;
    const float start = ray.t0[i] - foot, whole = std::fmax(ray.t1[i] - ray.t0[i], 0.f);
    const float range = angleOf(height * whole, height * height + start * (start + whole));
    const float angle = place * range;
    const float s = sineOf(angle), c = cosineOf(angle);
    // tan(a + b) - tan(a), over one denominator
    const float along = s * (height * height + start * start) / std::fmax(height * c - start * s, 1e-20f);
    const float in = std::fmin(std::fmax(along, 0.f), whole);
    const float from = start + in, d2 = height * height + from * from, inverse = 1 / std::sqrt(d2);
    // 1 / d^2 and the density height / (range d^2) cancel.
    const float cosine = lampCosine(lamp, ray.dx[i] * from - ex, ray.dy[i] * from - ey, ray.dz[i] * from - ez, inverse);
    const float g = ray.anisotropy[i], toward = from * inverse;  // dot(wo, wi): wo = -d, wi = (y - p) / |y - p|
    const float q = 1 + g * g + 2 * g * toward;
    const float light = kInverse4Pi * (1 - g * g) / (q * std::sqrt(q)) * cosine * range / height;
    const float t = ray.t0[i] + in;
    at.px[i] = ray.ox[i] + ray.dx[i] * t, at.py[i] = ray.oy[i] + ray.dy[i] * t, at.pz[i] = ray.oz[i] + ray.dz[i] * t;
    for (int channel = 0; channel < 3; ++channel)
      value[channel][i] = light * ray.sigmaT[channel][i] * std::exp(-ray.sigmaT[channel][i] * in);
  }
}

/// Rays from places that are lit (value > 0) to the lamp, as aimAt() makes them. `offset`: where each starts beside its
/// place.
VIRGA_HD static inline void aimAtLamp(const LampPoint& lamp, const KernelPlaces& from, const float* offset,
                                      const float* gx, const float* gy, const float* gz, const float* value,
                                      float relativeError, float scale, RayPacket& rays) {
#pragma omp simd
  for (int i = 0; i < RayPacket::kSize; ++i) {
    const float ox = from.px[i] + gx[i] * offset[i], oy = from.py[i] + gy[i] * offset[i],
                oz = from.pz[i] + gz[i] * offset[i];
    const float x = lamp.px - ox, y = lamp.py - oy, z = lamp.pz - oz;
    const float d = std::sqrt(x * x + y * y + z * z) + 1e-20f, inverse = 1 / d;
    const float most = std::fmax(std::fabs(ox), std::fmax(std::fabs(oy), std::fabs(oz)));
    const float end = d * (1 - 10 * relativeError) - relativeError * std::fmax(0.5f * most, 5e-2f * scale);
    rays.ox[i] = ox, rays.oy[i] = oy, rays.oz[i] = oz;
    rays.dx[i] = x * inverse, rays.dy[i] = y * inverse, rays.dz[i] = z * inverse;
    rays.tMax[i] = value[i] > 0 ? end : 0.f;
  }
}

}  // namespace kernels

// --- to be called; defined in frame_kernels.cpp ---

/// kernels::lampOnSurfaces, and the rays.
void lightSurfaces(const LampPoint& lamp, const KernelSurfaces& surfaces, float scale, float* value, RayPacket& rays);
/// kernels::lampInMedia, and the rays.
void lightMedia(const LampPoint& lamp, const KernelPlaces& places, float scale, float* value, RayPacket& rays);
/// kernels::lampInFog, and the rays.
void lightFog(const LampPoint& lamp, const FogRays& fog, float place, float scale, KernelPlaces& at,
              float (*value)[RayPacket::kSize], RayPacket& rays);

}  // namespace virga
