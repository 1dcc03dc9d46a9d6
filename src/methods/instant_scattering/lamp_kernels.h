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
  int medium = -1;               ///< EmitterView::medium
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
  alignas(64) int medium[RayPacket::kSize];                      ///< its index
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

// Loops over rays take vectors only where all that they call is inlined early: hence the attribute.

/// A ray through fog as seen from a lamp. Distances [unit] along it count from where it enters the fog.
struct LitRay {
  float foot, height;  ///< of the lamp: along the ray, from its origin, and beside it
  float ex, ey, ez;    ///< from the foot to the lamp
  float start, whole;  ///< of the stretch in fog, from the foot; its length
  float range;         ///< angle that it fills [rad]

  /// Distance at a share of that angle: tan(a + b) - tan(a), over one denominator (Kulla and Fajardo 2012).
  [[gnu::always_inline]] VIRGA_HD inline float distanceAt(float share) const {
    const float angle = share * range, s = sineOf(angle), c = cosineOf(angle);
    const float along = s * (height * height + start * start) / std::fmax(height * c - start * s, 1e-20f);
    return std::fmin(std::fmax(along, 0.f), whole);
  }
  VIRGA_HD inline float squareTo(float in) const { return height * height + (start + in) * (start + in); }
};
[[gnu::always_inline]] VIRGA_HD static inline LitRay litRay(const LampPoint& lamp, const FogRays& ray, int i) {
  const float x = lamp.px - ray.ox[i], y = lamp.py - ray.oy[i], z = lamp.pz - ray.oz[i];
  const float foot = x * ray.dx[i] + y * ray.dy[i] + z * ray.dz[i];
  const float ex = x - ray.dx[i] * foot, ey = y - ray.dy[i] * foot, ez = z - ray.dz[i] * foot;
  const float height = std::sqrt(ex * ex + ey * ey + ez * ez) + 1e-4f * std::fabs(foot) + 1e-12f;
  const float start = ray.t0[i] - foot, whole = std::fmax(ray.t1[i] - ray.t0[i], 0.f);
  return {foot, height, ex, ey, ez, start, whole, angleOf(height * whole, height * height + start * (start + whole))};
}
/// Cosine at the lamp times phase function at a distance along a ray [1/sr].
[[gnu::always_inline]] VIRGA_HD static inline float scatteredAt(const LampPoint& lamp, const FogRays& ray,
                                                                const LitRay& lit, float in, int i) {
  const float from = lit.start + in, inverse = 1 / std::sqrt(lit.squareTo(in));
  const float cosine =
      lampCosine(lamp, ray.dx[i] * from - lit.ex, ray.dy[i] * from - lit.ey, ray.dz[i] * from - lit.ez, inverse);
  const float g = ray.anisotropy[i], toward = from * inverse;  // dot(wo, wi): wo = -d, wi = (y - p) / |y - p|
  const float q = 1 + g * g + 2 * g * toward;
  return kInverse4Pi * (1 - g * g) / (q * std::sqrt(q)) * cosine;
}
/// Optical depth of the densest channel along a stretch.
VIRGA_HD static inline float thickest(const FogRays& ray, int i) {
  const float most = std::fmax(ray.sigmaT[0][i], std::fmax(ray.sigmaT[1][i], ray.sigmaT[2][i]));
  return most * std::fmax(ray.t1[i] - ray.t0[i], 0.f);
}

/// Where a lamp lights rays through fog, and what that adds for each channel, but for albedo, intensity, visibility and
/// the transmittance from the lamp: at the share `place` of the angle that the ray fills as seen from the lamp. `value`
/// is the light of a lamp that sends 1 W/sr along its normal.
VIRGA_HD static inline void lampInFog(const LampPoint& lamp, const FogRays& ray, float place, KernelPlaces& at,
                                      float (*__restrict value)[RayPacket::kSize]) {
#pragma omp simd
  for (int i = 0; i < RayPacket::kSize; ++i) {
    const LitRay lit = litRay(lamp, ray, i);
    const float in = lit.distanceAt(place), t = ray.t0[i] + in;
    // 1 / d^2 and the density height / (range d^2) cancel.
    const float light = scatteredAt(lamp, ray, lit, in, i) * lit.range / lit.height;
    at.px[i] = ray.ox[i] + ray.dx[i] * t, at.py[i] = ray.oy[i] + ray.dy[i] * t, at.pz[i] = ray.oz[i] + ray.dz[i] * t;
    for (int channel = 0; channel < 3; ++channel)
      value[channel][i] = light * ray.sigmaT[channel][i] * falling(ray.sigmaT[channel][i] * in);
  }
}

/// Is the angle not enough to say where the light is? From a lamp in the same fog it is for longer: far from it there
/// is less light to be found.
VIRGA_HD static inline bool isDense(const LampPoint& lamp, const FogRays& ray, int i) {
  constexpr float kWithin = 4, kOutside = 1;  // optical depth
  return thickest(ray, i) > (ray.medium[i] == lamp.medium ? kWithin : kOutside);
}
/// Light along rays through dense fog, at some places in order.
struct FogProfile {
  static constexpr int kAngles = 8, kDepths = 8, kPlaces = kAngles + kDepths;
  alignas(64) float in[kPlaces][RayPacket::kSize];     ///< distances, from 0 to the end of the stretch [unit]
  alignas(64) float light[kPlaces][RayPacket::kSize];  ///< what comes from there, over the intensity [1/unit^3]
};

/// What comes from a place, mean of the channels. From a lamp in the same fog it is as much as the fog leaves;
/// what lies before others is not known.
VIRGA_HD static inline float lightFrom(const LampPoint& lamp, const FogRays& ray, const LitRay& lit, float in, int i) {
  const float d2 = lit.squareTo(in), way = in + (ray.medium[i] == lamp.medium ? std::sqrt(d2) : 0.f);
  float sum = 0;
  for (int c = 0; c < 3; ++c) sum += ray.sigmaT[c][i] * falling(ray.sigmaT[c][i] * way);
  return sum * scatteredAt(lamp, ray, lit, in, i) / d2;
}
/// Places by angle and by optical depth, in order by a bitonic merge (Batcher 1968).
VIRGA_HD static inline void profileFog(const LampPoint& lamp, const FogRays& ray, FogProfile& p) {
  constexpr float kDepth[FogProfile::kDepths] = {0, 0.2f, 0.5f, 1, 1.8f, 3, 5, 9};  // of the densest channel
  for (int n = 0; n < FogProfile::kAngles; ++n) {
#pragma omp simd
    for (int i = 0; i < RayPacket::kSize; ++i) {
      const LitRay lit = litRay(lamp, ray, i);
      const float perDepth = lit.whole / std::fmax(thickest(ray, i), 1e-20f);
      p.in[n][i] =
          n + 1 < FogProfile::kAngles ? lit.distanceAt(static_cast<float>(n + 1) / FogProfile::kAngles) : lit.whole;
      p.in[FogProfile::kPlaces - 1 - n][i] = std::fmin(kDepth[n] * perDepth, lit.whole);
    }
  }
  for (int step = FogProfile::kPlaces / 2; step > 0; step /= 2)
    for (int n = 0; n < FogProfile::kPlaces; ++n) {
      if (n & step) continue;
#pragma omp simd
      for (int i = 0; i < RayPacket::kSize; ++i) {
        const float a = p.in[n][i], b = p.in[n + step][i];
        p.in[n][i] = std::fmin(a, b), p.in[n + step][i] = std::fmax(a, b);
      }
    }
  for (int n = 0; n < FogProfile::kPlaces; ++n) {
#pragma omp simd
    for (int i = 0; i < RayPacket::kSize; ++i)
      p.light[n][i] = lightFrom(lamp, ray, litRay(lamp, ray, i), p.in[n][i], i);
  }
}

/// A part of a profile: where it begins and how long it is, the light at both ends, and how much there is before it.
struct FogPart {
  alignas(64) float begin[RayPacket::kSize], width[RayPacket::kSize], first[RayPacket::kSize], last[RayPacket::kSize];
  alignas(64) float before[RayPacket::kSize], all[RayPacket::kSize];  ///< and in the whole profile [1/unit^2]
};
/// The part that holds the share `place` of the light.
VIRGA_HD static inline void findPart(const FogProfile& p, float place, FogPart& part) {
  const auto between = [&](int n, int i) {
    return 0.5f * (p.in[n + 1][i] - p.in[n][i]) * (p.light[n][i] + p.light[n + 1][i]);
  };
  alignas(64) float passed[RayPacket::kSize];
  for (int i = 0; i < RayPacket::kSize; ++i) {
    part.begin[i] = part.width[i] = part.first[i] = part.last[i] = part.before[i] = part.all[i] = passed[i] = 0;
  }
  for (int n = 0; n + 1 < FogProfile::kPlaces; ++n) {
#pragma omp simd
    for (int i = 0; i < RayPacket::kSize; ++i) part.all[i] += between(n, i);
  }
  for (int n = 0; n + 1 < FogProfile::kPlaces; ++n) {
#pragma omp simd
    for (int i = 0; i < RayPacket::kSize; ++i) {
      const float own = between(n, i);
      const bool here = (passed[i] <= place * part.all[i]) & (own > 0);
      part.begin[i] = here ? p.in[n][i] : part.begin[i];
      part.width[i] = here ? p.in[n + 1][i] - p.in[n][i] : part.width[i];
      part.first[i] = here ? p.light[n][i] : part.first[i];
      part.last[i] = here ? p.light[n + 1][i] : part.last[i];
      part.before[i] = here ? passed[i] : part.before[i];
      passed[i] += own;
    }
  }
}
/// As lampInFog, on rays whose fog is dense: at the share `place` of the light along the ray, which is taken to be
/// linear between the profile's places.
VIRGA_HD static inline void lampInDenseFog(const LampPoint& lamp, const FogRays& ray, const FogProfile& profile,
                                           float place, KernelPlaces& at, float (*__restrict value)[RayPacket::kSize]) {
  FogPart part;
  findPart(profile, place, part);
#pragma omp simd
  for (int i = 0; i < RayPacket::kSize; ++i) {
    // first x + (last - first) x^2 / 2 = what is left of the share, over the width
    const float left = (place * part.all[i] - part.before[i]) / std::fmax(part.width[i], 1e-30f);
    const float first = part.first[i], slope = part.last[i] - first;
    const float root = std::sqrt(std::fmax(first * first + 2 * slope * left, 0.f));
    const float x = std::fmin(2 * left / std::fmax(first + root, 1e-37f), 1.f), density = first + slope * x;
    const float in = part.begin[i] + part.width[i] * x, t = ray.t0[i] + in;
    const LitRay lit = litRay(lamp, ray, i);
    const float scattered = scatteredAt(lamp, ray, lit, in, i) * part.all[i];
    const float light = density > 0 ? scattered / (density * lit.squareTo(in)) : 0.f;
    const bool dense = isDense(lamp, ray, i);
    at.px[i] = dense ? ray.ox[i] + ray.dx[i] * t : at.px[i];
    at.py[i] = dense ? ray.oy[i] + ray.dy[i] * t : at.py[i];
    at.pz[i] = dense ? ray.oz[i] + ray.dz[i] * t : at.pz[i];
    for (int c = 0; c < 3; ++c) {
      const float own = light * ray.sigmaT[c][i] * falling(ray.sigmaT[c][i] * in);
      value[c][i] = dense ? own : value[c][i];
    }
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
/// kernels::lampInFog, kernels::lampInDenseFog where it is, and the rays.
void lightFog(const LampPoint& lamp, const FogRays& fog, float place, float scale, KernelPlaces& at,
              float (*value)[RayPacket::kSize], RayPacket& rays);

}  // namespace virga
