// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/visibility.h"
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
  // A stretch without end is dark beyond so many mean free paths.
  if (std::isinf(end)) end = begin + 40 / thickest;
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
      const int count = std::min(kMarchedAtOnce, to + 1 - n0);
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
    if (!(a < b)) continue;
    const Vec3 p = ray.at(0.5f * (a + b));
    Rgb sigmaT;
    for (int i = 0; i < media.count(); ++i) sigmaT += scene.media[media.medium(i)].sigmaTAt(p);
    if (!visit(a, b, sigmaT * (b - a))) return false;
  }
  return true;
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

/// An eye ray: the media that it passes, by marching, and the surface that it meets.
struct MarchedEye {
  static constexpr int kSteps = 128;  ///< through each stretch of media
  static constexpr int kMostStretches = 8, kMostSteps = kMostStretches * (kSteps + 1);

  /// A step along the ray. Plain numbers, so that an eye is not cleared before it is filled.
  struct Step {
    float t0, t1;
    float before[3], own[3];  ///< optical depth to it, and its own
    int stretch;              ///< which of `media` holds there

    VIRGA_HD Rgb depthBefore() const { return {before[0], before[1], before[2]}; }
    VIRGA_HD Rgb depth() const { return {own[0], own[1], own[2]}; }
  };

  MediaRay at;  ///< its media are those at the surface, or at the end, or where all before it is opaque
  RayHit hit;
  Rgb depth;  ///< optical depth of all of it
  int steps = 0, stretches = 0;
  Step step[kMostSteps];
  MediaState media[kMostStretches];
  SurfacePoint point;  ///< where it meets a surface, as the following ones
  Side side;
  Bsdf textured;

  bool plain = true;  ///< no mirror, glass or narrow bsdf is met, and no more stretches than can be kept

  /// Nothing behind such an optical depth counts: about 1e-7 of it is seen.
  static constexpr float kOpaque = 16;

  VIRGA_HD bool opaque() const { return minComponent(depth) > kOpaque; }
  VIRGA_HD float opacity() const { return 1 - std::exp(-mean(depth)); }

  /// Points in equal parts of what is seen of the media, each of them at `shift` in [0, 1) of its part:
  /// visit(k, point, sigma_t tau over the density with which it was chosen, media).
  template <class Visit>
  VIRGA_HD void visitPoints(int count, float shift, Visit&& visit) const {
    const float seen = opacity();
    if (!(seen > 0) || steps == 0) return;
    int i = 0;
    for (int k = 0; k < count; ++k) {
      const float reached = -std::log1p(-seen * (static_cast<float>(k) + shift) / static_cast<float>(count));
      while (i + 1 < steps && mean(step[i + 1].depthBefore()) <= reached) ++i;
      const Step& s = step[i];
      const Rgb before = s.depthBefore(), own = s.depth();
      const float here = clamp((reached - mean(before)) / mean(own), 0, 1);
      // The density is that of the mean channel.
      const Rgb passed = before + own * here;
      const Rgb weight = own * transmittanceOf(passed) * (seen / (mean(own) * std::exp(-mean(passed))));
      visit(k, at.ray.at(lerp(s.t0, s.t1, here)), weight, media[s.stretch]);
    }
  }
};

/// What an eye ray meets, and all that it passes: stretch(t0, t1) of the media that `eye.at` holds then, until it
/// returns false. `hit`: what the ray meets.
template <class Rays, class Stretch>
VIRGA_HD void walkEye(const SceneView& scene, const Rays& rays, const CameraRay& camera, const RayHit& hit,
                      MarchedEye& eye, Stretch&& stretch) {
  eye.at = leaveCamera(scene, camera.ray);
  eye.hit = hit;
  eye.depth = Rgb();
  eye.steps = eye.stretches = 0;
  eye.plain = true;
  if (eye.hit.found()) {
    eye.point = surfacePoint(scene.surfaces[eye.hit.shape], eye.at.ray, eye.hit, scene.scale);
    eye.side = sideOf(scene, eye.point, eye.hit, -eye.at.ray.d, eye.textured);
    eye.plain = eye.side.bsdf->broad();
  }
  walkMedia(scene, rays, eye.at, eye.hit.found() ? eye.hit.t : camera.tMax,
            [&](float t0, float t1) { return eye.at.media.vacuum() || stretch(t0, t1); });
}

/// Marches an eye ray through its next stretch, the media of which it holds; steps are shifted by `shift`. Returns
/// whether what lies behind it counts.
VIRGA_HD inline bool marchStretch(const SceneView& scene, MarchedEye& eye, float t0, float t1, float shift, int steps) {
  const bool kept = eye.stretches < MarchedEye::kMostStretches;
  eye.plain &= kept;
  if (kept) eye.media[eye.stretches] = eye.at.media;
  marchMedia(scene, eye.at.media, eye.at.ray, t0, t1, steps, shift, [&](float a, float b, Rgb here) {
    if (kept && eye.steps < MarchedEye::kMostSteps && !isBlack(here))
      eye.step[eye.steps++] = {a, b, {eye.depth.r, eye.depth.g, eye.depth.b}, {here.r, here.g, here.b}, eye.stretches};
    eye.depth += here;
    return !eye.opaque();
  });
  eye.stretches += kept ? 1 : 0;
  return !eye.opaque();
}

/// Fills `eye`, steps shifted by `shift`; at most MarchedEye::kSteps of them. `hit`: what the ray meets.
template <class Rays>
VIRGA_HD void marchEye(const SceneView& scene, const Rays& rays, const CameraRay& camera, const RayHit& hit,
                       float shift, MarchedEye& eye, int steps = MarchedEye::kSteps) {
  walkEye(scene, rays, camera, hit, eye,
          [&](float t0, float t1) { return marchStretch(scene, eye, t0, t1, shift, steps); });
}
template <class Rays>
VIRGA_HD void marchEye(const SceneView& scene, const Rays& rays, const CameraRay& camera, float shift, MarchedEye& eye,
                       int steps = MarchedEye::kSteps) {
  marchEye(scene, rays, camera, rays.nearest(camera.ray, camera.tMax), shift, eye, steps);
}

}  // namespace virga
