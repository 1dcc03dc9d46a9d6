// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/vertex.h"

namespace virga {

/// A ray that is to reach a place, and how far it may go.
struct ConnectingRay {
  MediaRay at;
  float tMax = 0;  ///< 0 where the ends are too close together for anything to lie between them
};

/// Aims `r`, which starts at the connection's one end or, off a surface, a little beside it, anew at the other end: it
/// would meet the surface there before it is expected to. It stops short of that surface, beyond the errors of both
/// ends, whose coordinates may be large.
VIRGA_HD inline ConnectingRay aimAt(const SceneView& scene, MediaRay r, Vec3 end) {
  const Vec3 toEnd = end - r.ray.o;
  const float d = length(toEnd);
  const float tMax =
      d * (1 - 10 * kHitError) - kHitError * std::max(0.5f * maxComponent(abs(r.ray.o)), 5e-2f * scene.scale);
  if (tMax <= 0) return {r, 0};
  r.ray.d = toEnd / d;
  return {r, tMax};
}

/// Transmittance along a ray, 0 where a surface is in the way that is not thin glass. Light that passes thin glass is
/// noted in `layers`.
template <class Rays>
VIRGA_HD Rgb throughThinGlass(const SceneView& scene, const Rays& rays, MediaRay r, float tMax, LayerPath& layers,
                              Pcg32& random) {
  const Vec3 d = r.ray.d, end = r.ray.at(tMax);
  Rgb seen(1.f);
  while (!isBlack(seen)) {
    const RayHit hit = rays.nearest(r.ray, tMax);
    if (!hit.found()) return seen * passMedia(scene, rays, r, tMax, random);
    const SurfacePoint point = surfacePoint(scene.surfaces[hit.shape], r.ray, hit, scene.scale);
    Bsdf textured;
    const Side side = sideOf(scene, point, hit, -d, textured);
    if (!side.bsdf->isThin()) return {};
    seen *= passMedia(scene, rays, r, hit.t, random) * side.bsdf->straight(side.wo.z);
    layers.scatterSpecularly();
    r = leaveSurface(scene, point, -d, d, r.media);
    if (!std::isinf(tMax)) tMax = dot(end - r.ray.o, d);
    if (tMax <= 0) return seen;
  }
  return seen;
}

/// Transmittance times visibility from x to the point that was sampled on a light; 0 where a surface is in the way.
/// `r` starts at x or, off a surface, a little beside it. Light that passes thin glass is noted in `layers`.
template <class Rays>
VIRGA_HD Rgb visibility(const SceneView& scene, const Rays& rays, const MediaRay& r, Vec3 x, const LightSample& light,
                        LayerPath& layers, Pcg32& random) {
  ConnectingRay ray{r, kInfinity};
  if (!std::isinf(light.distance)) ray = aimAt(scene, r, x + light.wi * light.distance);
  if (!(ray.tMax > 0)) return Rgb(1.f);
  if (scene.thinGlass) return throughThinGlass(scene, rays, ray.at, ray.tMax, layers, random);
  if (rays.occluded(ray.at.ray, ray.tMax)) return {};
  return passMedia(scene, rays, ray.at, ray.tMax, random);
}

}  // namespace virga
