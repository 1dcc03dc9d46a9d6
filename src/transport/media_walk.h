// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rays/ray_scene.h"
#include "scene/scene_view.h"
#include "transport/tracking.h"

namespace virga {

/// The ray queries that kernels need, over Embree. A device has its own type with the same functions.
struct EmbreeRays {
  const RayScene& surfaces;
  const RayScene& boundaries;

  RayHit nearest(const Ray& ray, float tMax) const { return surfaces.nearest(ray, 0, tMax); }
  bool occluded(const Ray& ray, float tMax) const { return surfaces.occluded(ray, 0, tMax); }
  void crossings(const Ray& ray, float tMin, float tMax, CrossingList& list) const {
    boundaries.crossings(ray, tMin, tMax, list);
  }
};

/// A ray that knows the media at its start. `behind` >= 0: crossings up to that far behind the origin still apply, because the
/// origin was moved off a surface that may coincide with a boundary.
struct MediaRay {
  Ray ray;
  MediaState media;
  float behind = 0;
};

VIRGA_HD inline void applyCrossing(const SceneView& scene, const Crossing& crossing, MediaState& media) {
  const MediumTransition& transition = scene.boundaries[crossing.shape];
  if (transition.replaces) {
    media.replace(crossing.entering ? transition.interior : transition.exterior);
  } else if (crossing.entering) {
    media.enter(static_cast<int>(crossing.shape), transition.interior);
  } else {
    media.leave(static_cast<int>(crossing.shape), transition.interior);
  }
}

/// Intervals of constant media along [0, tMax]: visit(t0, t1) while `media` holds the interval's media, until it returns false.
/// Afterwards `media` is what holds where the walk ended. Boundaries are gathered as sorted crossings, never stepped over.
template <class Rays, class Visit>
VIRGA_HD void walkMedia(const SceneView& scene, const Rays& rays, MediaRay& r, float tMax, Visit&& visit) {
  float t = 0;
  if (scene.boundaries.size > 0) {
    float from = -r.behind;
    for (CrossingList list;; list.count = 0, list.complete = true) {
      rays.crossings(r.ray, from, tMax, list);
      for (int i = 0; i < list.count; ++i) {
        const Crossing& c = list.items[static_cast<size_t>(i)];
        if (c.t > t) {
          if (!visit(t, c.t)) return;
          t = c.t;
        }
        applyCrossing(scene, c, r.media);
      }
      if (list.complete) break;
      from = std::nextafter(list.items[CrossingList::kCapacity - 1].t, kInfinity);
    }
  }
  if (t < tMax) visit(t, tMax);
}

/// A real collision: where, and with which medium.
struct Collision {
  float t = kInfinity;
  int medium = -1;

  VIRGA_HD bool found() const { return medium >= 0; }
};

/// The first real collision within [t0, t1] in the media of the state. Coefficients add where media overlap, so the collision is
/// the nearest of independent free flights.
VIRGA_HD inline Collision sampleCollision(const SceneView& scene, const MediaRay& r, float t0, float t1, Pcg32& random) {
  Collision nearest;
  for (int i = 0; i < r.media.count(); ++i) {
    const int medium = r.media.medium(i);
    const float t = sampleFreeFlight(scene.media[medium], r.ray, t0, std::fmin(t1, nearest.t), random);
    if (t < nearest.t) nearest = {t, medium};
  }
  return nearest;
}

/// Unbiased estimate of the transmittance along [0, tMax], null boundaries passed; surfaces are not looked at.
template <class Rays>
VIRGA_HD float transmittance(const SceneView& scene, const Rays& rays, MediaRay r, float tMax, Pcg32& random) {
  float product = 1;
  walkMedia(scene, rays, r, tMax, [&](float t0, float t1) {
    for (int i = 0; i < r.media.count() && product > 0; ++i)
      product *= estimateTransmittance(scene.media[r.media.medium(i)], r.ray, t0, t1, random);
    return product > 0;
  });
  return product;
}

}  // namespace virga
