// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene_view.h"

namespace virga {

/// A ray that leaves a light, chosen at random; `flux` is what the light emits over the density of the choice [W].
struct EmittedRay {
  Ray ray;
  Rgb flux;
};

/// Spheres that shares of the rays are aimed at, the others being as they would be without them. Rays are weighted by
/// the density of all ways to draw them together (the balance heuristic; Veach 1997, 9.2), so that the expectation is
/// the same.
struct EmissionTargets {
  static constexpr int kMost = 8;
  struct Sphere {
    Vec3 center;
    float radius = 0;  ///< [unit]
    float share = 0;   ///< > 0
  };

  Sphere spheres[kMost];  ///< their shares together: < 1
  int count = 0;

  VIRGA_HD void add(const Sphere& s) { spheres[count++] = s; }
};

/// A part of the rays, aimed at a disk (lights at infinity: as seen along the rays) or a cone (from a place).
struct AimedPart {
  Vec3 axis;        ///< cone: unit; disk: from the middle of the light's own disk to its middle
  float width = 0;  ///< cone: 1 - cosine of its half angle; disk: radius [unit]
  float share = 0;  ///< of the rays
};

/// Those that can be aimed from one light.
struct AimedParts {
  AimedPart parts[EmissionTargets::kMost];
  int count = 0;
  float rest = 1;  ///< share of the rays that are not aimed

  VIRGA_HD void add(const AimedPart& part) { parts[count++] = part, rest -= part.share; }

  /// Takes the choice out of a random number: which part, or -1.
  VIRGA_HD int choose(float& u) const {
    constexpr float kBelow1 = 0x1.fffffep-1f;
    for (int i = 0; i < count; ++i) {
      if (u < parts[i].share) {
        u = std::fmin(u / parts[i].share, kBelow1);
        return i;
      }
      u -= parts[i].share;
    }
    u = std::fmin(std::fmax(u, 0.f) / rest, kBelow1);
    return -1;
  }
};

/// Lights at infinity send their rays through a disk that hides all of `reach`, from outside of it, or through the
/// targets.
VIRGA_HD inline EmittedRay fromInfinity(const Bounds& reach, Vec3 travel, Rgb irradiance, Vec2 u,
                                        const EmissionTargets& targets) {
  const Vec3 center = reach.center();
  const float radius = 0.5f * length(reach.extent()) * (1 + 1e-3f);
  AimedParts aimed;
  for (int i = 0; i < targets.count; ++i) {
    const EmissionTargets::Sphere& s = targets.spheres[i];
    const Vec3 way = s.center - center;
    aimed.add({way - travel * dot(way, travel), s.radius, s.share});
  }
  const int part = aimed.choose(u.x);
  const Vec2 d = uniformDisk(u);
  const Frame frame(travel);
  Vec3 place = (frame.s * d.x + frame.t * d.y) * (part >= 0 ? aimed.parts[part].width : radius);
  if (part >= 0) place += aimed.parts[part].axis;
  if (part >= 0 && length(place) > radius) return {};
  float density = aimed.rest / (kPi * square(radius));
  for (int i = 0; i < aimed.count; ++i) {
    const AimedPart& disk = aimed.parts[i];
    // One aimed at the rim may be off it by rounding.
    if (i == part || distance(place, disk.axis) < disk.width) density += disk.share / (kPi * square(disk.width));
  }
  return {{center + place - travel * radius, travel}, irradiance / density};
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

/// The cones that targets fill as they are seen from a place. What is all around it has none: it is met anyway.
VIRGA_HD inline AimedParts conesFrom(Vec3 p, const EmissionTargets& targets) {
  AimedParts aimed;
  for (int i = 0; i < targets.count; ++i) {
    const EmissionTargets::Sphere& s = targets.spheres[i];
    const Vec3 way = s.center - p;
    const float d = length(way);
    if (d > 1.001f * s.radius) aimed.add({way / d, coneHeight(s.radius, d), s.share});
  }
  return aimed;
}

/// From a place, some directions into the cones of the targets.
VIRGA_HD inline EmittedRay sampleDirection(const EmitterView& emitter, const EmissionPlace& place, Vec2 u,
                                           const EmissionTargets& targets) {
  const AimedParts aimed = conesFrom(place.p, targets);
  if (aimed.count == 0) {
    const Vec3 w = place.sample(emitter, u);
    return {{place.p, w}, place.flux(emitter, w)};
  }
  const int part = aimed.choose(u.x);
  const Vec3 w = part < 0 ? place.sample(emitter, u)
                          : Frame(aimed.parts[part].axis).toWorld(uniformCone(u, aimed.parts[part].width));
  const float own = place.pdf(emitter, w);
  if (!(own > 0)) return {};
  float mixture = aimed.rest * own;
  for (int i = 0; i < aimed.count; ++i) {
    const AimedPart& cone = aimed.parts[i];
    const bool within = i == part || lengthSquared(w - cone.axis) < 2 * cone.width;  // |w - axis|^2 = 2 (1 - cosine)
    if (within) mixture += cone.share / (kTwoPi * cone.width);
  }
  return {{place.p, w}, place.flux(emitter, w) * (own / mixture)};
}

/// Samples where and whither `emitter` sends light; the choice of the emitter is not counted. `reach`: all that light
/// from infinity is to meet. Black where a ray was aimed at a target from where no light goes to it.
VIRGA_HD inline EmittedRay sampleEmittedRay(const SceneView& scene, const EmitterView& emitter, const Bounds& reach,
                                            Vec2 uPosition, Vec2 uDirection, const EmissionTargets& targets = {}) {
  if (!emitter.infinite())
    return sampleDirection(emitter, sampleEmissionPlace(scene, emitter, uPosition), uDirection, targets);
  if (emitter.kind == EmitterView::Kind::directional)
    return fromInfinity(reach, emitter.direction, emitter.value, uPosition, targets);
  const LightSample s = sampleLight(scene, emitter, scene.bounds.center(), uDirection);
  return s.pdf > 0 ? fromInfinity(reach, -s.wi, s.radiance / s.pdf, uPosition, targets) : EmittedRay{};
}

}  // namespace virga
