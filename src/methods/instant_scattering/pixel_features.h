// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/eye_march.h"
#include "scene/scene.h"

namespace virga {

/// What a pixel shows, as far as it says how like another's its multiply scattered light is.
struct PixelFeatures {
  bool regular = false;  ///< false: a mirror or glass is seen, of which nothing can be said
  float depth = 0;       ///< to the surface along the ray [unit]; infinite without one
  Vec3 p, normal;        ///< of the surface, world; the normal toward the eye
  Rgb surface;           ///< its reflectance times the transmittance to it: what light on it is seen through
  Rgb opacity;           ///< 1 - transmittance to the surface, or to the end: likewise for light from the media
  float mediaDepth = 0;  ///< mean distance of the media, by how much of them is seen there [unit]
};

/// Mean of t in [0, 1] by exp(-d t): 1 / d - 1 / (exp(d) - 1), or its series up to an error of 4e-5. `before` and
/// `after`: the transmittances to both ends of the step.
VIRGA_HD inline float meanPlaceOfStep(float d, float before, float after) {
  return d > 1 && before > after ? 1 / d - after / (before - after) : 0.5f - d / 12 + d * d * d / 720;
}

/// Mean distance of the media along an eye ray, by how much of them is seen there and the mean of the channels [unit];
/// 0 if nothing is.
VIRGA_HD inline float meanMediaDepth(const MarchedEye& eye) {
  double weight = 0, moment = 0;
  float depth = 0, before = 1;
  for (int i = 0; i < eye.steps; ++i) {
    const MarchedEye::Step& step = eye.step[i];
    const float own = mean(step.depth());
    depth += own;
    const float after = std::exp(-depth), seen = before - after;
    weight += static_cast<double>(seen);
    moment += static_cast<double>(seen * lerp(step.t0, step.t1, meanPlaceOfStep(own, before, after)));
    before = after;
  }
  return weight > 0 ? static_cast<float>(moment / weight) : 0;
}

/// A colour by which a surface's light may be divided; of bsdfs other than diffuse ones nothing is known.
VIRGA_HD inline Rgb reflectanceOf(const Side& side) {
  if (side.bsdf->kind() != Bsdf::Kind::diffuse) return Rgb(1.f);
  const Rgb r = side.bsdf->value(Vec3(0, 0, 1), Vec3(0, 0, 1)) * kPi;
  return side.wo.z > 0 ? r : Rgb();
}

/// Of an eye ray, whose steps need not have been kept; `mediaDepth` as above.
VIRGA_HD inline PixelFeatures pixelFeatures(const MarchedEye& eye, float mediaDepth) {
  PixelFeatures f;
  f.regular = true;
  f.depth = eye.hit.found() ? eye.hit.t : kInfinity;
  const Rgb transmittance = transmittanceOf(eye.depth);
  f.opacity = Rgb(1.f) - transmittance;
  f.mediaDepth = mediaDepth;
  if (!eye.hit.found()) return f;
  f.regular = !eye.side.bsdf->specular() && !eye.side.bsdf->isThin();
  f.p = eye.point.p;
  f.normal = dot(eye.point.shadingNormal, eye.at.ray.d) > 0 ? -eye.point.shadingNormal : eye.point.shadingNormal;
  f.surface = transmittance * reflectanceOf(eye.side);
  return f;
}
VIRGA_HD inline PixelFeatures pixelFeatures(const MarchedEye& eye) { return pixelFeatures(eye, meanMediaDepth(eye)); }

/// The ray through the middle of pixel (x, y). Nothing is random; the steps of neighbours are shifted against each
/// other, so that what they miss does not add up to a pattern.
EyeStart middleOf(const Scene& scene, int x, int y);

}  // namespace virga
