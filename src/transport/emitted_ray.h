// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene_view.h"

namespace virga {

/// A ray that leaves a light, chosen at random; `flux` is what the light emits over the density of the choice [W].
struct EmittedRay {
  Ray ray;
  Rgb flux;
};

/// A sphere that a share of the rays is aimed at, the others being as they would be without it.
struct EmissionTarget {
  Vec3 center;
  float radius = 0;  ///< [unit]
  float share = 0;   ///< in [0, 1)
};

/// Takes the choice between the target and the rest out of a random number.
VIRGA_HD inline bool chooseTarget(const EmissionTarget& target, float& u) {
  const bool aimed = u < target.share;
  u = std::fmin(aimed ? u / target.share : (u - target.share) / (1 - target.share), 0x1.fffffep-1f);
  return aimed;
}

/// Lights at infinity send their rays through a disk that hides all of `reach`, from outside of it, or through the
/// target.
VIRGA_HD inline EmittedRay fromInfinity(const Bounds& reach, Vec3 travel, Rgb irradiance, Vec2 u,
                                        const EmissionTarget& target) {
  const Vec3 center = reach.center();
  const float radius = 0.5f * length(reach.extent()) * (1 + 1e-3f);
  const bool aimed = chooseTarget(target, u.x);
  const Vec2 d = uniformDisk(u);
  const Frame frame(travel);
  const Vec3 toTarget = target.center - center, across = toTarget - travel * dot(toTarget, travel);
  Vec3 place = (frame.s * d.x + frame.t * d.y) * (aimed ? target.radius : radius);
  if (aimed) place += across;
  if (aimed && length(place) > radius) return {};
  const bool onTarget = target.share > 0 && distance(place, across) < target.radius;
  const float own = (1 - target.share) / (kPi * square(radius));
  const float byTarget = onTarget ? target.share / (kPi * square(target.radius)) : 0;
  return {{center + place - travel * radius, travel}, irradiance / (own + byTarget)};
}

/// Where a light at a finite distance sends its rays from.
struct EmissionPlace {
  Vec3 p;
  Vec3 normal;       ///< of an area light
  Rgb scale;         ///< area light: radiance over the density of the place; otherwise 1
  float height = 0;  ///< spot: 1 - cosine of its half angle

  VIRGA_HD Vec3 sample(const EmitterView& emitter, Vec2 u) const {
    if (emitter.kind == EmitterView::Kind::point) return uniformSphere(u);
    if (emitter.kind == EmitterView::Kind::spot) return Frame(emitter.direction).toWorld(uniformCone(u, height));
    return Frame(normal).toWorld(cosineHemisphere(u));
  }
  /// [1/sr]
  VIRGA_HD float pdf(const EmitterView& emitter, Vec3 w) const {
    if (emitter.kind == EmitterView::Kind::point) return 1 / (4 * kPi);
    if (emitter.kind == EmitterView::Kind::spot)
      return lengthSquared(w - emitter.direction) < 2 * height * (1 + 1e-5f) ? 1 / (kTwoPi * height) : 0;
    return std::fmax(0.f, dot(normal, w)) / kPi;
  }
  /// Intensity toward w over pdf(w) [W], where that is not 0.
  VIRGA_HD Rgb flux(const EmitterView& emitter, Vec3 w) const {
    if (emitter.kind == EmitterView::Kind::point) return emitter.value * (4 * kPi);
    if (emitter.kind == EmitterView::Kind::spot) return emitter.intensity(w) * (kTwoPi * height);
    return scale * kPi;
  }
};

VIRGA_HD inline EmissionPlace sampleEmissionPlace(const SceneView& scene, const EmitterView& emitter, Vec2 u) {
  if (emitter.kind == EmitterView::Kind::point) return {emitter.position, {}, Rgb(1.f)};
  if (emitter.kind == EmitterView::Kind::spot)
    return {emitter.position, {}, Rgb(1.f), 2 * square(std::sin(0.5f * emitter.cutoffAngle))};
  const LightPoint on = uniformPointOnShape(scene.surfaces[emitter.shape], emitter, u);
  // The point is less exact than one that a ray has met: its error is that of the corners of its shape.
  const float aside = kHitError * std::max(maxComponent(abs(on.p)), 5e-2f * scene.scale);
  return {on.p + on.normal * aside, on.normal, emitter.radianceAt(on.uv) / on.areaPdf};
}

/// From a place, some directions into the cone that the target fills as it is seen from there.
VIRGA_HD inline EmittedRay sampleDirection(const EmitterView& emitter, const EmissionPlace& place, Vec2 u,
                                           const EmissionTarget& target) {
  const Vec3 toTarget = target.center - place.p;
  const float d = length(toTarget);
  if (!(target.share > 0) || !(d > 1.001f * target.radius)) {  // it is all around
    const Vec3 w = place.sample(emitter, u);
    return {{place.p, w}, place.flux(emitter, w)};
  }
  const float height = coneHeight(target.radius, d);
  const Vec3 axis = toTarget / d;
  const bool aimed = chooseTarget(target, u.x);
  const Vec3 w = aimed ? Frame(axis).toWorld(uniformCone(u, height)) : place.sample(emitter, u);
  const float own = place.pdf(emitter, w);
  const bool inCone = aimed || lengthSquared(w - axis) < 2 * height;  // |w - axis|^2 = 2 (1 - cosine)
  const float mixture = (1 - target.share) * own + (inCone ? target.share / (kTwoPi * height) : 0);
  if (!(own > 0)) return {};
  return {{place.p, w}, place.flux(emitter, w) * (own / mixture)};
}

/// Samples where and whither `emitter` sends light; the choice of the emitter is not counted. `reach`: all that light
/// from infinity is to meet. Black where a ray was aimed at the target from where no light goes to it.
VIRGA_HD inline EmittedRay sampleEmittedRay(const SceneView& scene, const EmitterView& emitter, const Bounds& reach,
                                            Vec2 uPosition, Vec2 uDirection, const EmissionTarget& target = {}) {
  if (!emitter.infinite())
    return sampleDirection(emitter, sampleEmissionPlace(scene, emitter, uPosition), uDirection, target);
  if (emitter.kind == EmitterView::Kind::directional)
    return fromInfinity(reach, emitter.direction, emitter.value, uPosition, target);
  const LightSample s = sampleLight(scene, emitter, scene.bounds.center(), uDirection);
  return s.pdf > 0 ? fromInfinity(reach, -s.wi, s.radiance / s.pdf, uPosition, target) : EmittedRay{};
}

}  // namespace virga
