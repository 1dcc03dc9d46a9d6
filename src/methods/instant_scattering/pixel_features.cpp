// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/pixel_features.h"

#include "core/random.h"
#include "methods/instant_scattering/eye_march.h"

namespace virga {
namespace {

/// Mean of t in [0, 1] by exp(-d t): 1 / d - 1 / (exp(d) - 1), or its series up to an error of 4e-5. `before` and
/// `after`: the transmittances to both ends of the step.
float meanDistance(float d, float before, float after) {
  return d > 1 && before > after ? 1 / d - after / (before - after) : 0.5f - d / 12 + d * d * d / 720;
}

/// Of what is seen of the media, by the mean of the channels; 0 if nothing is.
float meanDepth(const MarchedEye& eye) {
  double weight = 0, moment = 0;
  float depth = 0, before = 1;
  for (int i = 0; i < eye.steps; ++i) {
    const MarchedEye::Step& step = eye.step[i];
    const float own = mean(step.depth());
    depth += own;
    const float after = std::exp(-depth), seen = before - after;
    weight += static_cast<double>(seen);
    moment += static_cast<double>(seen * lerp(step.t0, step.t1, meanDistance(own, before, after)));
    before = after;
  }
  return weight > 0 ? static_cast<float>(moment / weight) : 0;
}

/// A colour by which the surface's light may be divided; of bsdfs other than diffuse ones nothing is known.
Rgb reflectanceOf(const Side& side) {
  if (side.bsdf->kind() != Bsdf::Kind::diffuse) return Rgb(1.f);
  const Rgb r = side.bsdf->value(Vec3(0, 0, 1), Vec3(0, 0, 1)) * kPi;
  return side.wo.z > 0 ? r : Rgb();
}

}  // namespace

PixelFeatures pixelFeatures(const MarchedEye& eye) { return pixelFeatures(eye, meanDepth(eye)); }

PixelFeatures pixelFeatures(const MarchedEye& eye, float mediaDepth) {
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

void marchMiddle(const Scene& scene, int x, int y, int steps, MarchedEye& eye) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const float shift = toUnitFloat(hash32(scene.camera.pixelStream(x, y)));
  const CameraRay camera = scene.camera.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  marchEye(scene.view, rays, camera, shift, eye, steps);
}

PixelFeatures pixelFeatures(const Scene& scene, int x, int y, int steps) {
  MarchedEye eye;
  marchMiddle(scene, x, y, steps, eye);
  return pixelFeatures(eye);
}

}  // namespace virga
