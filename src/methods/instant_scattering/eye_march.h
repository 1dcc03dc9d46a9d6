// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/media_march.h"
#include "transport/vertex.h"

namespace virga {

/// Where an eye ray starts, and by how much of a step the steps along it are shifted, in [0, 1).
struct EyeStart {
  CameraRay camera;
  float shift;
};

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
