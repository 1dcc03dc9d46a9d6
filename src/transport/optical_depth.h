// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/media_walk.h"

namespace virga {

/// Parts of [t0, t1] along a ray in a grid's index coordinates between which it crosses planes of voxel centres, where
/// the trilinear interpolant has its kinks: visit(a, b).
template <class Visit>
VIRGA_HD void forEachSmoothPiece(const GridView& grid, Vec3 o, Vec3 d, float t0, float t1, Visit&& visit) {
  const Vec3 lo(std::floor(grid.supportLo.x), std::floor(grid.supportLo.y), std::floor(grid.supportLo.z));
  const Vec3 origin = o - lo, start = origin + d * t0, size = grid.supportHi - lo;
  const auto planes = [](float extent) { return static_cast<int>(std::ceil(extent)) + 1; };
  int unused = 0;
  CellAxis x(planes(size.x), 0, start.x, origin.x, d.x, unused);
  CellAxis y(planes(size.y), 0, start.y, origin.y, d.y, unused);
  CellAxis z(planes(size.z), 0, start.z, origin.z, d.z, unused);
  for (float t = t0; t < t1;) {
    const float end = std::min(std::min(x.next, std::min(y.next, z.next)), t1);
    if (end > t) visit(t, end);
    t = std::max(t, end);
    x.advance(end, unused);
    y.advance(end, unused);
    z.advance(end, unused);
  }
}

/// Density along a ray through a grid, between the planes of voxel centres.
struct DensityAlong {
  const MediumView& medium;
  GridRay g;

  VIRGA_HD DensityAlong(const MediumView& inMedium, const Ray& ray) : medium(inMedium), g(inMedium, ray) {}
  VIRGA_HD Rgb at(float t) const {
    const Vec3 p = g.o + g.d * t;
    return medium.densityColors.values ? medium.densityColors.lookup(p) : Rgb(medium.density.lookupInside(p));
  }
  /// Integral over a piece: along a line a trilinear interpolant is piecewise cubic, and that is what two Gauss points
  /// integrate exactly.
  VIRGA_HD Rgb integral(float from, float to) const {
    constexpr float kGauss = 0.57735027f;  // 1 / sqrt(3)
    const float middle = 0.5f * (from + to), half = 0.5f * (to - from);
    return (at(middle - kGauss * half) + at(middle + kGauss * half)) * half;
  }
};

/// Optical depth of [t0, t1] in one medium, without an error but rounding.
VIRGA_HD inline Rgb opticalDepth(const MediumView& medium, const Ray& ray, float t0, float t1) {
  if (!(medium.sigmaT > 0)) return {};
  if (medium.homogeneous) return medium.depthOf(Rgb(t1 - t0));
  Rgb depth;
  const DensityAlong density(medium, ray);
  forEachMajorant(medium.density, density.g.o, density.g.d, t0, t1, [&](float a, float b, float majorant, bool inside) {
    if (!inside) depth += Rgb(majorant * (b - a));
    if (!inside || !(majorant > 0)) return true;
    forEachSmoothPiece(medium.density, density.g.o, density.g.d, a, b,
                       [&](float from, float to) { depth += density.integral(from, to); });
    return true;
  });
  return medium.depthOf(depth);
}

/// The other way round: where the optical depth of a channel from t0 on comes to `depth`; infinity if not before t1. It
/// changes as little as the medium does, as tracking would not.
VIRGA_HD inline float distanceOfDepth(const MediumView& medium, int channel, float depth, const Ray& ray, float t0,
                                      float t1) {
  const float sigmaT = medium.sigmaT * medium.spectrum[channel];
  if (!(sigmaT > 0)) return kInfinity;
  float left = depth / sigmaT, found = kInfinity;
  const auto passEven = [&](float a, float b, float density) {
    if (left < density * (b - a)) found = a + left / density;
    left -= density > 0 ? density * (b - a) : 0;
    return found == kInfinity;
  };
  if (medium.homogeneous) {
    passEven(t0, t1, 1);
    return found;
  }
  const DensityAlong density(medium, ray);
  const auto passPiece = [&](float from, float to) {
    if (found < kInfinity) return;
    const float here = density.integral(from, to)[channel];
    if (left < here) {
      constexpr int kHalvings = 12;
      float a = from, b = to;
      for (int i = 0; i < kHalvings; ++i) {
        const float middle = 0.5f * (a + b);
        (density.integral(from, middle)[channel] > left ? b : a) = middle;
      }
      found = 0.5f * (a + b);
    }
    left -= here;
  };
  forEachMajorant(medium.density, density.g.o, density.g.d, t0, t1, [&](float a, float b, float majorant, bool inside) {
    if (!inside) return passEven(a, b, majorant);
    if (majorant > 0) forEachSmoothPiece(medium.density, density.g.o, density.g.d, a, b, passPiece);
    return found == kInfinity;
  });
  return found;
}

/// Likewise, of all media along a ray; null boundaries are passed, surfaces are not looked at.
template <class Rays>
VIRGA_HD Rgb opticalDepth(const SceneView& scene, const Rays& rays, MediaRay r, float tMax) {
  Rgb depth;
  walkMedia(scene, rays, r, tMax, [&](float t0, float t1) {
    for (int i = 0; i < r.media.count(); ++i) depth += opticalDepth(scene.media[r.media.medium(i)], r.ray, t0, t1);
    return true;
  });
  return depth;
}

}  // namespace virga
