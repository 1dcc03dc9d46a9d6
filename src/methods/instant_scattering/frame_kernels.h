// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/host_device.h"

namespace virga {

// What a frame (`ims.mode=frame`) spends its time on: every virtual light lights every receiver. Plain loops over
// arrays; the functions at the end run them. They are compiled with -ffast-math, all of this has internal linkage, and
// nothing here may meet a NaN.

/// A virtual light: Lambertian on a surface, or in a medium.
struct KernelLight {
  float px, py, pz;
  float ax, ay, az;  ///< on a surface its normal; in a medium toward where the light came from
  float r, g, b;     ///< LightVertex::weight over the number of walks [W]
  float anisotropy;  ///< g of Henyey and Greenstein's phase function; 0 on surfaces
};

/// A place.
struct KernelPoint {
  float x, y, z;
};

/// Points that are lit, of one kind. Arrays of `count`.
struct KernelReceivers {
  int count = 0;
  const float *px, *py, *pz;
  const float *ax, *ay, *az;  ///< on a surface its shading normal; in a medium toward where the eye path came from
  const float* anisotropy;    ///< g, in a medium
  float *r, *g, *b;           ///< light is added here: over bsdf or albedo [1/unit^2 W]
};

/// How the ends of a connection scatter.
enum class EndKind { lambertian, isotropic, henyeyGreenstein };

/// The geometry term near a light.
struct NearField {
  enum class Kind {
    clamped,  ///< min(G, bound)
    spread    ///< the light is spread over a ball of 1 / sqrt(bound), its energy kept
  };
  Kind kind = Kind::clamped;
  float bound = 1;  ///< [1/unit^2]
};

/// Where a table of optical depths looks from a point: all around or, from outside of the media, into the cone that
/// they fill. Between two distances, radii whose steps grow, so that they are densest near the point.
struct DepthView {
  float ux, uy, uz, vx, vy, vz, wx, wy, wz;  ///< an orthonormal frame, w along the cone
  float stretch;      ///< 2 / (1 - cosine of the cone's half angle): 1 - cosine is stretched by it
  float first, last;  ///< [unit] there are no media before and beyond
};

/// Optical depths at directions and distances: nodes of an octahedral map of the stretched directions, and radii.
struct DepthTable {
  const float* depth;  ///< [row][column][radius]
  int side;            ///< nodes along the map's edge; those on its border are there twice
  int radii;           ///< the first at 0
  DepthView view;
};

/// Distances to the nearest surface around a light: ShadowMapsView, for one of them.
struct KernelShadowMap {
  const float* depths;
  int resolution;
  float bias;         ///< of a receiver that faces the light, relative to its distance
  float leastCosine;  ///< at flatter angles the bias grows no more
};

/// Fixed points of lamps, each of which lights one point of a ray through fog.
struct FogLamps {
  static constexpr int kCount = 4;

  bool known[kCount] = {};  ///< there is one
  bool alone = true;        ///< there are no lamps of other kinds
  float px[kCount] = {}, py[kCount] = {}, pz[kCount] = {};
  float nx[kCount] = {}, ny[kCount] = {}, nz[kCount] = {};  ///< normal; 0 where it sends to all sides alike
  float all[kCount] = {};                                   ///< 1 where it does, otherwise 0
  float r[kCount] = {}, g[kCount] = {}, b[kCount] = {};     ///< intensity along the normal, over kCount [W/sr]
};

/// A ray through one homogeneous medium, from t0 to t1.
struct FogRay {
  float ox, oy, oz, dx, dy, dz;
  float t0, t1;      ///< [unit]
  float sigmaT[3];   ///< [1/unit]
  float anisotropy;  ///< g
};

namespace kernels {

constexpr float kInverse4Pi = 0.07957747154594767f;

/// Cosine and scattering of an end, `c` the cosine between its axis and the way to the other end.
template <EndKind kind>
VIRGA_HD static inline float endCosine(float c) {
  return kind == EndKind::lambertian ? (c > 0 ? c : 0.f) : 1.f;
}
template <EndKind kind>
VIRGA_HD static inline float endScattering(float c, float g) {
  if (kind == EndKind::lambertian) return 1;
  if (kind == EndKind::isotropic) return kInverse4Pi;
  const float d = 1 + g * g + 2 * g * c;
  return kInverse4Pi * (1 - g * g) / (d * std::sqrt(d));
}

/// What takes the place of 1 / d^2 within the radius 1 / sqrt(bound) of a light that is spread: with s = d^2 bound a
/// polynomial that meets 1 / d^2 at s = 1 with the same slope, and whose integral over the ball is that of 1 / d^2.
VIRGA_HD static inline float spreadFalloff(float d2, float bound) {
  const float s = d2 * bound;
  return s < 1 ? bound * (9 + s * (7 * s - 15)) : 1 / d2;
}

/// One light, all receivers. `seen`: transmittance times visibility from the light to each of them, per channel.
template <EndKind light, EndKind receiver, NearField::Kind near>
VIRGA_HD static inline void gather(const KernelLight& l, const KernelReceivers& to, const float* seenR,
                                   const float* seenG, const float* seenB, float bound) {
  const float* __restrict px = to.px;
  const float* __restrict py = to.py;
  const float* __restrict pz = to.pz;
  float* __restrict r = to.r;
  float* __restrict g = to.g;
  float* __restrict b = to.b;
#pragma omp simd
  for (int i = 0; i < to.count; ++i) {
    const float x = l.px - px[i], y = l.py - py[i], z = l.pz - pz[i];
    const float d2 = x * x + y * y + z * z + 1e-20f;
    const float inverse = 1 / std::sqrt(d2);
    const float cl = -(l.ax * x + l.ay * y + l.az * z) * inverse;
    const float cr = (to.ax[i] * x + to.ay[i] * y + to.az[i] * z) * inverse;
    const float cosines = endCosine<light>(cl) * endCosine<receiver>(cr);
    const float term = near == NearField::Kind::clamped ? std::fmin(cosines * (inverse * inverse), bound)
                                                        : cosines * spreadFalloff(d2, bound);
    const float value = term * endScattering<light>(cl, l.anisotropy) *
                        endScattering<receiver>(cr, receiver == EndKind::henyeyGreenstein ? to.anisotropy[i] : 0);
    r[i] += value * l.r * seenR[i];
    g[i] += value * l.g * seenG[i];
    b[i] += value * l.b * seenB[i];
  }
}

/// Transmittance from a point through a homogeneous medium that is everywhere.
VIRGA_HD static inline void seenThroughFog(const KernelPoint& l, const KernelReceivers& to, float sigmaT, float* seen) {
#pragma omp simd
  for (int i = 0; i < to.count; ++i) {
    const float x = l.x - to.px[i], y = l.y - to.py[i], z = l.z - to.pz[i];
    seen[i] = std::exp(-sigmaT * std::sqrt(x * x + y * y + z * z));
  }
}

/// Where a direction lies on an octahedral map, in [-1, 1]^2 (Engelhardt and Dachsbacher 2008).
VIRGA_HD static inline void octahedral(float x, float y, float z, float& u, float& v) {
  const float inverse = 1 / (std::fabs(x) + std::fabs(y) + std::fabs(z));
  const float a = x * inverse, b = y * inverse;
  const float foldedA = std::copysign(1 - std::fabs(b), a), foldedB = std::copysign(1 - std::fabs(a), b);
  u = z >= 0 ? a : foldedA;
  v = z >= 0 ? b : foldedB;
}

/// Sets `seen` to 0 where a light's shadow map says that a surface is in the way: ShadowMapsView::visible().
template <EndKind receiver>
VIRGA_HD static inline void seenThroughMap(const KernelLight& l, const KernelReceivers& to, const KernelShadowMap& map,
                                           float* seen) {
  const float* __restrict depths = map.depths;
  const int resolution = map.resolution;
  const auto size = static_cast<float>(resolution);
#pragma omp simd
  for (int i = 0; i < to.count; ++i) {
    const float x = to.px[i] - l.px, y = to.py[i] - l.py, z = to.pz[i] - l.pz + 1e-10f;
    const float distance = std::sqrt(x * x + y * y + z * z);
    float u, v;
    octahedral(x, y, z, u, v);
    const int column = static_cast<int>(std::fmin((u + 1) * (0.5f * size), size - 1));
    const int row = static_cast<int>(std::fmin((v + 1) * (0.5f * size), size - 1));
    const float depth = depths[row * resolution + column];
    const float along = std::fabs(to.ax[i] * x + to.ay[i] * y + to.az[i] * z) / distance;
    const float cosine = receiver == EndKind::lambertian ? std::fmax(along, map.leastCosine) : 1;
    seen[i] = distance * (1 - std::fmin(map.bias / cosine, 0.5f)) <= depth ? seen[i] : 0;
  }
}

/// Multiplies `seen` by the transmittance that a point's table knows.
VIRGA_HD static inline void seenThroughTable(const KernelPoint& l, const KernelReceivers& to, const DepthTable& table,
                                             float* seen) {
  const int side = table.side, radii = table.radii;
  const float* __restrict depth = table.depth;
  const DepthView f = table.view;
  const auto columns = static_cast<float>(side), distances = static_cast<float>(radii);
  const float scale = (distances - 1) * (distances - 1) / (f.last - f.first);
#pragma omp simd
  for (int i = 0; i < to.count; ++i) {
    const float x = to.px[i] - l.x, y = to.py[i] - l.y, z = to.pz[i] - l.z + 1e-10f;
    const float distance = std::sqrt(x * x + y * y + z * z), inverse = 1 / distance;
    const float a = (f.ux * x + f.uy * y + f.uz * z) * inverse, b = (f.vx * x + f.vy * y + f.vz * z) * inverse;
    const float c = std::fmax(1 - (1 - (f.wx * x + f.wy * y + f.wz * z) * inverse) * f.stretch, -1.f);
    const float turned = std::sqrt(std::fmax(1 - c * c, 0.f) / (a * a + b * b + 1e-20f));
    float u, v;
    octahedral(a * turned, b * turned, c, u, v);
    u = (u + 1) * (0.5f * (columns - 1)), v = (v + 1) * (0.5f * (columns - 1));
    const float m = std::fmin(std::sqrt(std::fmax(distance - f.first, 0.f) * scale), distances - 1.001f);
    const int column = static_cast<int>(std::fmin(u, columns - 1.001f)),
              row = static_cast<int>(std::fmin(v, columns - 1.001f)), radius = static_cast<int>(m);
    const float fu = u - static_cast<float>(column), fv = v - static_cast<float>(row),
                fm = m - static_cast<float>(radius);
    const int at = (row * side + column) * radii + radius;
    const float d00 = depth[at] * (1 - fm) + depth[at + 1] * fm;
    const float d01 = depth[at + radii] * (1 - fm) + depth[at + radii + 1] * fm;
    const float d10 = depth[at + radii * side] * (1 - fm) + depth[at + radii * side + 1] * fm;
    const float d11 = depth[at + radii * (side + 1)] * (1 - fm) + depth[at + radii * (side + 1) + 1] * fm;
    seen[i] *= std::exp(-((d00 * (1 - fu) + d01 * fu) * (1 - fv) + (d10 * (1 - fu) + d11 * fu) * fv));
  }
}

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

/// Where lamps light the ray, and what that adds, but for albedo, visibility and the transmittance from the lamp: t at
/// the share `shift` of an equal part of the angle that the ray fills as seen from the lamp (Kulla and Fajardo 2012).
VIRGA_HD static inline void lightFog(const FogLamps& lamps, const FogRay& ray, float shift, float* __restrict t,
                                     float* __restrict r, float* __restrict g, float* __restrict b) {
  constexpr float kPart = 1.f / FogLamps::kCount;
#pragma omp simd
  for (int k = 0; k < FogLamps::kCount; ++k) {
    const float x = lamps.px[k] - ray.ox, y = lamps.py[k] - ray.oy, z = lamps.pz[k] - ray.oz;
    const float foot = x * ray.dx + y * ray.dy + z * ray.dz;
    const float ex = x - ray.dx * foot, ey = y - ray.dy * foot, ez = z - ray.dz * foot;
    const float height = std::sqrt(ex * ex + ey * ey + ez * ez) + 1e-4f * std::fabs(foot) + 1e-12f;
    const float start = ray.t0 - foot, whole = ray.t1 - ray.t0;
    const float range = angleOf(height * whole, height * height + start * (ray.t1 - foot));
    const float angle = (static_cast<float>(k) + shift) * kPart * range;
    const float s = sineOf(angle), c = cosineOf(angle);
    // tan(a + b) - tan(a), over one denominator
    const float along = s * (height * height + start * start) / std::fmax(height * c - start * s, 1e-20f);
    const float at = std::fmin(std::fmax(along, 0.f), whole);
    const float from = start + at, d2 = height * height + from * from, inverse = 1 / std::sqrt(d2);
    // 1 / d^2 and the density height / (range d^2) cancel.
    const float cosine =
        lamps.all[k] + std::fmax(0.f, (lamps.nx[k] * (ray.dx * from - ex) + lamps.ny[k] * (ray.dy * from - ey) +
                                       lamps.nz[k] * (ray.dz * from - ez)) *
                                          inverse);
    const float g2 = ray.anisotropy, toward = from * inverse;  // dot(wo, wi): wo = -d, wi = (y - p) / |y - p|
    const float q = 1 + g2 * g2 + 2 * g2 * toward;
    const float value = kInverse4Pi * (1 - g2 * g2) / (q * std::sqrt(q)) * cosine * range / height;
    t[k] = ray.t0 + at;
    r[k] = value * lamps.r[k] * ray.sigmaT[0] * std::exp(-ray.sigmaT[0] * at);
    g[k] = value * lamps.g[k] * ray.sigmaT[1] * std::exp(-ray.sigmaT[1] * at);
    b[k] = value * lamps.b[k] * ray.sigmaT[2] * std::exp(-ray.sigmaT[2] * at);
  }
}

}  // namespace kernels

// --- to be called; defined in frame_kernels.cpp ---

/// Adds the light of `light` to all receivers, seen by `seen[channel]`, arrays of `to.count` transmittances.
void gatherLight(const KernelLight& light, EndKind from, const KernelReceivers& to, EndKind kind,
                 const float* const seen[3], const NearField& near);
/// exp(-sigmaT d) for each receiver.
void lookThroughFog(const KernelPoint& from, const KernelReceivers& to, float sigmaT, float* seen);
/// Multiplies `seen` by 1 or 0: what the light's shadow map says.
void lookThroughMap(const KernelLight& light, const KernelReceivers& to, EndKind kind, const KernelShadowMap& map,
                    float* seen);
/// Multiplies `seen` by what the point's table says.
void lookThroughTable(const KernelPoint& from, const KernelReceivers& to, const DepthTable& table, float* seen);
/// kernels::lightFog
void lightFog(const FogLamps& lamps, const FogRay& ray, float shift, float* t, float* r, float* g, float* b);

}  // namespace virga
