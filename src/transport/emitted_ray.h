// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene_view.h"

namespace virga {

/// A ray that leaves a light, chosen at random; `flux` is what the light emits over the density of the choice [W].
struct EmittedRay {
  Ray ray;
  Rgb flux;
};

/// Lights at infinity send their rays through a disk that hides the whole scene.
VIRGA_HD inline EmittedRay fromInfinity(const SceneView& scene, Vec3 travel, Rgb irradiance, Vec2 u) {
  const Vec3 center = scene.bounds.center();
  const float radius = 0.5f * length(scene.bounds.extent()) * (1 + 1e-3f);
  const Vec2 d = uniformDisk(u);
  const Frame frame(travel);
  const Vec3 origin = center + (frame.s * d.x + frame.t * d.y - travel) * radius;
  return {{origin, travel}, irradiance * (kPi * radius * radius)};
}

/// Samples where and whither `emitter` sends light; the choice of the emitter is not counted.
VIRGA_HD inline EmittedRay sampleEmittedRay(const SceneView& scene, const EmitterView& emitter, Vec2 uPosition,
                                            Vec2 uDirection) {
  switch (emitter.kind) {
    case EmitterView::Kind::point:
      return {{emitter.position, uniformSphere(uDirection)}, emitter.value * (4 * kPi)};
    case EmitterView::Kind::spot: {
      const float height = 2 * square(std::sin(0.5f * emitter.cutoffAngle));  // 1 - cos
      const Vec3 w = Frame(emitter.direction).toWorld(uniformCone(uDirection, height));
      return {{emitter.position, w}, emitter.intensity(w) * (kTwoPi * height)};
    }
    case EmitterView::Kind::area: {
      const LightPoint on = uniformPointOnShape(scene.surfaces[emitter.shape], emitter, uPosition);
      const Vec3 w = Frame(on.normal).toWorld(cosineHemisphere(uDirection));
      // The point is less exact than one that a ray has met: its error is that of the corners of its shape.
      const float aside = kHitError * std::max(maxComponent(abs(on.p)), 5e-2f * scene.scale);
      return {{on.p + on.normal * aside, w}, emitter.radianceAt(on.uv) * (kPi / on.areaPdf)};
    }
    case EmitterView::Kind::directional:
      return fromInfinity(scene, emitter.direction, emitter.value, uPosition);
    case EmitterView::Kind::constant:
    case EmitterView::Kind::environment: {
      const LightSample s = sampleLight(scene, emitter, scene.bounds.center(), uDirection);
      return s.pdf > 0 ? fromInfinity(scene, -s.wi, s.radiance / s.pdf, uPosition) : EmittedRay{};
    }
  }
  return {};
}

}  // namespace virga
