// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

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

/// A value for each channel.
struct KernelRgb {
  float r, g, b;
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
    spread    ///< the light is spread over a ball of 1 / sqrt(bound)
  };
  static constexpr float kPlainCore = 7;

  Kind kind = Kind::clamped;
  float bound = 1;                                        ///< [1/unit^2]
  KernelRgb core = {kPlainCore, kPlainCore, kPlainCore};  ///< how bright the ball's middle is (spreadFalloff())

  bool grey() const { return core.r == core.g && core.r == core.b; }
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
  static constexpr int kMostSize = 1 << 24;  ///< side * side * radii stays below it

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

namespace kernels {

constexpr float kInverse4Pi = 0.07957747154594767f;

/// exp(-x) of x >= 0, relative error 3e-7: in loops that hold more than an exponential a call of the library's vector
/// code would send all that is in registers to memory.
VIRGA_HD static inline float falling(float x) {
  const float t = std::fmin(x, 87.f) * -1.4426950f, whole = std::rint(t), f = (t - whole) * 0.69314718f;
  // The exponential's series for |f| <= log(2) / 2.
  const float series = 1 + f * (1 + f * (1 / 2.f + f * (1 / 6.f + f * (1 / 24.f + f * (1 / 120.f + f * (1 / 720.f))))));
  return series * std::bit_cast<float>((static_cast<int32_t>(whole) + 127) << 23);
}

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
/// polynomial that meets 1 / d^2 at s = 1 with the same slope. For a core of 7 its integral over the ball is that of
/// 1 / d^2; coreFor() has others.
VIRGA_HD static inline float spreadFalloff(float d2, float bound, float core) {
  const float t = 1 - d2 * bound;
  return t > 0 ? bound * (1 + t * (1 + t * core)) : 1 / d2;
}

/// The geometry term of a connection, `inverse` over its length: clamped...
struct Clamped {
  float bound;

  VIRGA_HD KernelRgb term(float cosines, float, float inverse) const {
    const float all = std::fmin(cosines * (inverse * inverse), bound);
    return {all, all, all};
  }
};
/// ...of a light that is spread, by one core for all channels, as in grey media...
struct Spread {
  float bound, core;

  VIRGA_HD KernelRgb term(float cosines, float d2, float) const {
    const float all = cosines * spreadFalloff(d2, bound, core);
    return {all, all, all};
  }
};
/// ...or by one for each.
struct SpreadByChannel {
  float bound;
  KernelRgb core;

  VIRGA_HD KernelRgb term(float cosines, float d2, float) const {
    return {cosines * spreadFalloff(d2, bound, core.r), cosines * spreadFalloff(d2, bound, core.g),
            cosines * spreadFalloff(d2, bound, core.b)};
  }
};

/// Light at a receiver from the light at (x, y, z) from it, `inverse` over that distance: over the light's weight and
/// what lies between them. `cr`: cosine at the receiver. `near`: Clamped, Spread or SpreadByChannel.
template <EndKind light, EndKind receiver, class Near>
VIRGA_HD static inline KernelRgb connected(const KernelLight& l, float x, float y, float z, float d2, float inverse,
                                           float cr, float anisotropy, const Near& near) {
  const float cl = -(l.ax * x + l.ay * y + l.az * z) * inverse;
  const KernelRgb term = near.term(endCosine<light>(cl) * endCosine<receiver>(cr), d2, inverse);
  const float scattering = endScattering<light>(cl, l.anisotropy) * endScattering<receiver>(cr, anisotropy);
  return {term.r * scattering, term.g * scattering, term.b * scattering};
}

/// Transmittance from a point through a homogeneous medium that is everywhere.
VIRGA_HD static inline void seenThroughFog(const KernelPoint& l, const KernelReceivers& to, float sigmaT, float* seen) {
#pragma omp simd
  for (int i = 0; i < to.count; ++i) {
    const float x = l.x - to.px[i], y = l.y - to.py[i], z = l.z - to.pz[i];
    seen[i] = falling(sigmaT * std::sqrt(x * x + y * y + z * z));
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

/// What a shadow map says in a direction from its light.
VIRGA_HD static inline float depthToward(const KernelShadowMap& map, float x, float y, float z) {
  const auto size = static_cast<float>(map.resolution);
  float u, v;
  octahedral(x, y, z, u, v);
  const int column = static_cast<int>(std::fmin((u + 1) * (0.5f * size), size - 1));
  const int row = static_cast<int>(std::fmin((v + 1) * (0.5f * size), size - 1));
  return map.depths[row * map.resolution + column];
}

/// Does it say that nothing is in the way? `cr`: cosine at a receiver of a kind (ShadowMapsView::visible()).
template <EndKind receiver>
VIRGA_HD static inline bool reaches(const KernelShadowMap& map, float depth, float distance, float cr) {
  const float cosine = receiver == EndKind::lambertian ? std::fmax(std::fabs(cr), map.leastCosine) : 1;
  return distance * (1 - std::fmin(map.bias / cosine, 0.5f)) <= depth;
}

/// Sets `seen` to 0 where a light's shadow map says that a surface is in the way.
template <EndKind receiver>
VIRGA_HD static inline void seenThroughMap(const KernelLight& l, const KernelReceivers& to, const KernelShadowMap& map,
                                           float* seen) {
#pragma omp simd
  for (int i = 0; i < to.count; ++i) {
    const float x = to.px[i] - l.px, y = to.py[i] - l.py, z = to.pz[i] - l.pz + 1e-10f;
    const float distance = std::sqrt(x * x + y * y + z * z);
    const float cr = (to.ax[i] * x + to.ay[i] * y + to.az[i] * z) / distance;
    seen[i] = reaches<receiver>(map, depthToward(map, x, y, z), distance, cr) ? seen[i] : 0;
  }
}

/// Optical depth that a point's table knows toward (x, y, z) from it, `inverse` over that distance.
VIRGA_HD static inline float depthToward(const DepthTable& table, float x, float y, float z, float distance,
                                         float inverse) {
  const DepthView& f = table.view;
  const float* __restrict depth = table.depth;
  const float* __restrict right = depth + table.radii;
  const float* __restrict below = depth + table.radii * table.side;
  const float* __restrict across = below + table.radii;
  const auto columns = static_cast<float>(table.side), distances = static_cast<float>(table.radii);
  const float scale = (distances - 1) * (distances - 1) / (f.last - f.first);
  const float a = (f.ux * x + f.uy * y + f.uz * z) * inverse, b = (f.vx * x + f.vy * y + f.vz * z) * inverse;
  const float c = std::fmax(1 - (1 - (f.wx * x + f.wy * y + f.wz * z) * inverse) * f.stretch, -1.f);
  const float turned = std::sqrt(std::fmax(1 - c * c, 0.f) / (a * a + b * b + 1e-20f));
  float u, v;
  octahedral(a * turned, b * turned, c, u, v);
  u = (u + 1) * (0.5f * (columns - 1)), v = (v + 1) * (0.5f * (columns - 1));
  const float m = std::fmin(std::sqrt(std::fmax(distance - f.first, 0.f) * scale), distances - 1.001f);
  const auto column = static_cast<float>(static_cast<int>(std::fmin(u, columns - 1.001f)));
  const auto row = static_cast<float>(static_cast<int>(std::fmin(v, columns - 1.001f)));
  const auto radius = static_cast<float>(static_cast<int>(m));
  const float fu = u - column, fv = v - row, fm = m - radius;
  // In floats, which know all integers below 2^24: vector code multiplies them faster.
  const int at = static_cast<int>((row * columns + column) * distances + radius);
  const float d00 = depth[at] * (1 - fm) + depth[at + 1] * fm;
  const float d01 = right[at] * (1 - fm) + right[at + 1] * fm;
  const float d10 = below[at] * (1 - fm) + below[at + 1] * fm;
  const float d11 = across[at] * (1 - fm) + across[at + 1] * fm;
  return (d00 * (1 - fu) + d01 * fu) * (1 - fv) + (d10 * (1 - fu) + d11 * fu) * fv;
}

/// Multiplies `seen` by the transmittance that a point's table knows.
VIRGA_HD static inline void seenThroughTable(const KernelPoint& l, const KernelReceivers& to, const DepthTable& table,
                                             float* seen) {
#pragma omp simd
  for (int i = 0; i < to.count; ++i) {
    const float x = to.px[i] - l.x, y = to.py[i] - l.y, z = to.pz[i] - l.z + 1e-10f;
    const float distance = std::sqrt(x * x + y * y + z * z);
    seen[i] *= falling(depthToward(table, x, y, z, distance, 1 / distance));
  }
}

/// What is seen of a receiver, transmittance times visibility: as arrays say...
struct SeenInArrays {
  const float *r, *g, *b;

  VIRGA_HD KernelRgb at(int i, float, float, float, float, float, float) const { return {r[i], g[i], b[i]}; }
};
/// ...or through grey media and the light's shadow map, by the way (x, y, z) to the receiver, `inverse` over its
/// length, and the cosine there. Most frames spend their time here.
template <EndKind receiver, class Between>
struct SeenThrough {
  Between between;
  KernelShadowMap map;

  VIRGA_HD KernelRgb at(int, float x, float y, float z, float distance, float inverse, float cr) const {
    const bool seen = reaches<receiver>(map, depthToward(map, x, y, z + 1e-10f), distance, cr);
    const float through = falling(between.depth(x, y, z + 1e-10f, distance, inverse));
    const float all = seen ? through : 0.f;
    return {all, all, all};
  }
};

/// What lies between: a fog that is everywhere...
struct FogBetween {
  float sigmaT;

  VIRGA_HD float depth(float, float, float, float distance, float) const { return sigmaT * distance; }
};
/// ...or what the light's table knows.
struct TableBetween {
  DepthTable table;

  VIRGA_HD float depth(float x, float y, float z, float distance, float inverse) const {
    return depthToward(table, x, y, z, distance, inverse);
  }
};

/// One light, all receivers. `between`: SeenInArrays or SeenThrough.
template <EndKind light, EndKind receiver, class Between, class Near>
VIRGA_HD static inline void gather(const KernelLight& l, const KernelReceivers& to, const Between between,
                                   const Near near) {
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
    const float cr = (to.ax[i] * x + to.ay[i] * y + to.az[i] * z) * inverse;
    const float anisotropy = receiver == EndKind::henyeyGreenstein ? to.anisotropy[i] : 0;
    const KernelRgb value = connected<light, receiver>(l, x, y, z, d2, inverse, cr, anisotropy, near);
    const KernelRgb seen = between.at(i, -x, -y, -z, d2 * inverse, inverse, cr);
    r[i] += value.r * seen.r * l.r;
    g[i] += value.g * seen.g * l.g;
    b[i] += value.b * seen.b * l.b;
  }
}

}  // namespace kernels

// --- to be called; defined in frame_kernels.cpp ---

/// Adds the light of `light` to all receivers, seen by `seen[channel]`, arrays of `to.count` transmittances.
void gatherLight(const KernelLight& light, EndKind from, const KernelReceivers& to, EndKind kind,
                 const float* const seen[3], const NearField& near);
/// gatherLight() through the light's shadow map and what its table knows or, without one, a fog of sigmaT [1/unit] that
/// is everywhere. All is grey: of `near` the core of red holds for all channels.
void gatherThrough(const KernelLight& light, EndKind from, const KernelReceivers& to, EndKind kind,
                   const DepthTable* table, float sigmaT, const KernelShadowMap& map, const NearField& near);
/// exp(-sigmaT d) for each receiver.
void lookThroughFog(const KernelPoint& from, const KernelReceivers& to, float sigmaT, float* seen);
/// Multiplies `seen` by 1 or 0: what the light's shadow map says.
void lookThroughMap(const KernelLight& light, const KernelReceivers& to, EndKind kind, const KernelShadowMap& map,
                    float* seen);
/// Multiplies `seen` by what the point's table says.
void lookThroughTable(const KernelPoint& from, const KernelReceivers& to, const DepthTable& table, float* seen);

}  // namespace virga
