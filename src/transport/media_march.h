// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/media_walk.h"
#include "volume/lookup_along.h"

namespace virga {

/// The medium's density is a dense grid of scalars with nothing around it, small enough for lookupAlong().
VIRGA_HD inline bool isPlainGrid(const MediumView& medium) {
  const GridView& grid = medium.density;
  if (medium.homogeneous || grid.kind != GridView::Kind::dense || grid.background > 0) return false;
  return !medium.densityColors.values && double{1} * grid.dense.nx * grid.dense.ny * grid.dense.nz < 2147483648.0;
}

/// The part of a ray between the first and the last coarse cell that holds anything.
VIRGA_HD inline ClippedRange whereFilled(const MediumView& medium, const Ray& ray, float t0, float t1) {
  const GridRay inGrid(medium, ray);
  ClippedRange filled{t1, t0};
  forEachMajorant(medium.density, inGrid.o, inGrid.d, t0, t1, [&](float a, float b, float majorant, bool) {
    if (majorant > 0) filled.t0 = std::min(filled.t0, a), filled.t1 = b;
    return true;
  });
  return filled;
}

/// Steps whose densities are looked up together.
inline constexpr int kMarchedAtOnce = 32;

/// Behind this optical depth a float's transmittance is 0.
inline constexpr float kDark = 120;
/// How far it is until all channels that are not clear are dark [unit], if that can be said in floats; 0 in a vacuum.
VIRGA_HD inline float darkWithin(Rgb sigmaT) {
  float least = kInfinity;
  for (int c = 0; c < 3; ++c)
    if (sigmaT[c] > 0) least = std::min(least, sigmaT[c]);
  return std::min(kDark / least, 1e15f);
}

/// Optical depth of the media along a ray by steps of equal length, the first of them shifted by `shift` in [0, 1), so
/// that neighbouring rays do not step in step: visit(t0, t1, optical depth of the step, media) front to back, until it
/// returns false. Homogeneous media are exact, and a single step.
template <class Visit>
VIRGA_HD bool marchMedia(const SceneView& scene, const MediaState& media, const Ray& ray, float t0, float t1, int steps,
                         float shift, Visit&& visit) {
  float begin = t1, end = t0, thickest = 0;
  bool homogeneous = true;
  for (int i = 0; i < media.count(); ++i) {
    const MediumView& medium = scene.media[media.medium(i)];
    homogeneous &= medium.homogeneous;
    thickest = std::max(thickest, medium.sigmaT);
    ClippedRange in{t0, t1};
    if (!medium.homogeneous && !(medium.density.background > 0))
      in = clipToBox(medium.worldToDensity.point(ray.o), medium.worldToDensity.vector(ray.d), medium.density.supportLo,
                     medium.density.supportHi, t0, t1);
    if (!(in.t0 < in.t1)) continue;
    begin = std::min(begin, in.t0), end = std::max(end, in.t1);
  }
  if (!(begin < end) || !(thickest > 0)) return true;
  const auto sigmaTAt = [&](Vec3 p) {
    Rgb sum;
    for (int i = 0; i < media.count(); ++i) sum += scene.media[media.medium(i)].sigmaTAt(p);
    return sum;
  };
  // Of a stretch without end this much is marched in steps, and in one step what lies behind it.
  const bool endless = std::isinf(end);
  if (endless) end = begin + (homogeneous ? darkWithin(sigmaTAt(ray.at(begin))) : 40 / thickest);
  if (homogeneous) steps = 1, shift = 0;
  const float step = (end - begin) / static_cast<float>(steps);
  const auto border = [&](int n) { return begin + step * std::max(0.f, static_cast<float>(n) - shift); };
  const MediumView& first = scene.media[media.medium(0)];
  if (media.count() == 1 && isPlainGrid(first)) {
    const ClippedRange filled = whereFilled(first, ray, begin, end);
    if (!(filled.t0 < filled.t1)) return true;
    // Step n goes from n - shift to n + 1 - shift; the same steps as without this, but those that are empty.
    const int from = std::max(0, static_cast<int>((filled.t0 - begin) / step + shift - 0.01f));
    const int to = std::min(steps, static_cast<int>((filled.t1 - begin) / step + shift + 0.01f));
    float density[kMarchedAtOnce];
    for (int n0 = from; n0 <= to; n0 += kMarchedAtOnce) {
      const int left = to + 1 - n0, count = left < kMarchedAtOnce ? left : kMarchedAtOnce;
      // The first step and the last may be cut: their middles are off by less than half a step.
      const GridRay inGrid(first, {ray.at(begin + step * (static_cast<float>(n0) + 0.5f - shift)), ray.d * step});
      lookupAlong(first.density, inGrid.o, inGrid.d, count, density);
      for (int n = 0; n < count; ++n) {
        const float a = border(n0 + n), b = std::min(end, border(n0 + n + 1));
        if (a < b && !visit(a, b, first.spectrum * (first.sigmaT * density[n] * (b - a)))) return false;
      }
    }
    return true;
  }
  for (int n = 0; n <= steps; ++n) {
    const float a = border(n), b = std::min(end, border(n + 1));
    if (a < b && !visit(a, b, sigmaTAt(ray.at(0.5f * (a + b))) * (b - a))) return false;
  }
  if (!endless || homogeneous) return true;
  const Rgb behind = sigmaTAt(ray.at(end));
  const float length = darkWithin(behind);
  return !(length > 0) || visit(end, end + length, behind * length);
}

/// Of an optical depth. Mostly it is grey, and one exponential does, or there is nothing.
VIRGA_HD inline Rgb transmittanceOf(Rgb depth) {
  if (isBlack(depth)) return Rgb(1.f);
  return isGrey(depth) ? Rgb(std::exp(-depth.r)) : exp(depth * -1);
}

/// Transmittance along a ray by marching; null boundaries are passed, surfaces are not looked at.
template <class Rays>
VIRGA_HD Rgb marchedTransmittance(const SceneView& scene, const Rays& rays, MediaRay r, float tMax, int steps,
                                  float shift) {
  Rgb depth;
  walkMedia(scene, rays, r, tMax, [&](float t0, float t1) {
    return marchMedia(scene, r.media, r.ray, t0, t1, steps, shift, [&](float, float, Rgb here) {
      depth += here;
      return true;
    });
  });
  return transmittanceOf(depth);
}

}  // namespace virga
