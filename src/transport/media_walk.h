// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rays/ray_hit.h"
#include "scene/scene_view.h"
#include "transport/emission.h"

namespace virga {

/// A ray that knows the media at a point on the way to its start.
struct MediaRay {
  Ray ray;
  MediaState media;    ///< at the point `behind` before the origin
  float behind = 0;    ///< [unit]
  Vec3 approach = {};  ///< unit direction from that point to the origin; without length: the ray's own
};

/// The ray that leaves a surface toward w. A boundary may coincide with the surface (a cloud that stands on the
/// ground), and `media` may have been found on either side of it: crossings are looked for across the surface, from
/// side to side.
VIRGA_HD inline MediaRay leaveSurface(const SurfacePoint& point, Vec3 w, const MediaState& media) {
  const Vec3 across = dot(w, point.geometricNormal) >= 0 ? point.geometricNormal : -point.geometricNormal;
  return {{point.originToward(w), w}, media, 4 * point.epsilon, across};
}

/// A camera ray, whose start may lie behind boundaries that the eye lies before or exactly on.
VIRGA_HD inline MediaRay leaveCamera(const SceneView& scene, const Ray& ray) {
  const Vec3 approach = ray.o - scene.cameraMediaPoint;
  const float behind = length(approach);
  return {ray, scene.cameraMedia, behind, behind > 0 ? approach / behind : Vec3(0)};
}

VIRGA_HD inline void applyCrossing(const SceneView& scene, const Crossing& crossing, MediaState& media) {
  const MediumTransition& transition = scene.boundaries[crossing.shape];
  if (transition.replaces) {
    media.pass(transition, crossing.entering ? Passing::inward : Passing::outward);
  } else if (crossing.entering) {
    media.enter(static_cast<int>(crossing.shape), transition.interior);
  } else {
    media.leave(static_cast<int>(crossing.shape), transition.interior);
  }
}

/// Crossings that are no farther apart than the error of their distances are at one place.
inline constexpr float kPlaceError = 2e-6f;
/// How far behind a place the media are looked up where the crossings do not tell; likewise relative.
inline constexpr float kBehindPlace = 1e-4f;

/// Next crossing of one closed boundary along a ray that has nothing to do with the scene: leaving, if p lies inside.
template <class Rays>
VIRGA_HD bool insideBoundary(const Rays& rays, uint32_t shape, Vec3 p) {
  const Ray ray{p, {0.6214712f, 0.4827161f, 0.6170366f}};
  CrossingList list;
  for (float from = 0;; list.clear()) {
    rays.crossings(ray, from, kInfinity, list);
    for (int i = 0; i < list.count; ++i)
      if (list.items[i].shape == shape) return !list.items[i].entering;
    if (list.complete) return false;
    from = std::nextafter(list.items[list.count - 1].t, kInfinity);
  }
}

/// Applies the crossings of one place. Where a boundary is entered and left at once, or may have been, the ray touches
/// or passes an edge or a corner: a point behind it decides.
template <class Rays>
VIRGA_HD void applyPlace(const SceneView& scene, const Rays& rays, const Crossing* crossings, int count, Vec3 behind,
                         MediaState& media) {
  for (int i = 0; i < count; ++i) {
    Crossing c = crossings[i];
    bool doubtful = c.doubtful;
    for (int j = 0; j < count; ++j) doubtful |= crossings[j].shape == c.shape && crossings[j].entering != c.entering;
    if (doubtful && scene.boundaries[c.shape].closed) c.entering = insideBoundary(rays, c.shape, behind);
    applyCrossing(scene, c, media);
  }
}

/// Places along [0, tMax] where the ray crosses boundaries, in order: visit(t) before the media change there, until it
/// returns false. Returns false if it did.
template <class Rays, class Visit>
VIRGA_HD bool walkPlaces(const SceneView& scene, const Rays& rays, const Ray& ray, float tMax, MediaState& media,
                         Visit&& visit) {
  const float scale = maxComponent(abs(ray.o));
  CrossingList list;
  for (float from = 0;; list.clear()) {
    rays.crossings(ray, from, tMax, list);
    for (int first = 0, last = 0; first < list.count; first = last) {
      const float t = list.items[first].t, end = t + kPlaceError * (scale + t);
      while (last < list.count && list.items[last].t <= end) ++last;
      if (!list.complete && last == list.count && first > 0) {
        from = std::nextafter(t, -kInfinity);  // the list may have been cut within this place: ask for all of it
        break;
      }
      if (!visit(t)) return false;
      const float here = list.items[last - 1].t, next = last < list.count ? list.items[last].t : kInfinity;
      const Vec3 behind = ray.at(std::min(here + kBehindPlace * (scale + here), 0.5f * (here + next)));
      applyPlace(scene, rays, list.items + first, last - first, behind, media);
      from = std::nextafter(here, kInfinity);
    }
    if (list.complete) return true;
  }
}

/// Intervals of constant media along [0, tMax]: visit(t0, t1) while `r.media` holds the interval's media, until it
/// returns false. Afterwards `r.media` is what holds where the walk ended. Boundaries are gathered as sorted crossings,
/// never stepped over.
template <class Rays, class Visit>
VIRGA_HD void walkMedia(const SceneView& scene, const Rays& rays, MediaRay& r, float tMax, Visit&& visit) {
  float t = 0;
  if (scene.boundaries.size > 0) {
    if (r.behind > 0) {
      const Vec3 d = lengthSquared(r.approach) > 0 ? r.approach : r.ray.d;
      walkPlaces(scene, rays, {r.ray.o - d * r.behind, d}, r.behind, r.media, [](float) { return true; });
      r.behind = 0;
    }
    const bool finished = walkPlaces(scene, rays, r.ray, tMax, r.media, [&](float next) {
      if (next <= t) return true;
      const float start = t;
      t = next;
      return visit(start, next);
    });
    if (!finished) return;
  }
  if (t < tMax) visit(t, tMax);
}

/// A real collision: where, and with which medium.
struct Collision {
  float t = kInfinity;
  int medium = -1;

  VIRGA_HD bool found() const { return medium >= 0; }
};

/// The first collision before t1 in the media of the state. Coefficients add where media overlap, so it is the nearest
/// of independent free flights: flight(medium, end) returns the distance of one, or infinity.
template <class Flight>
VIRGA_HD Collision nearestCollision(const MediaState& media, float t1, Flight&& flight) {
  Collision nearest;
  for (int i = 0; i < media.count(); ++i) {
    const int medium = media.medium(i);
    const float t = flight(medium, std::min(t1, nearest.t));
    if (t < nearest.t) nearest = {t, medium};
  }
  return nearest;
}

/// The first real collision within [t0, t1]. `spectral`, where there is one, takes part (SpectralFlight).
template <class... Spectral>
VIRGA_HD Collision sampleCollision(const SceneView& scene, const MediaRay& r, float t0, float t1, Pcg32& random,
                                   Spectral&... spectral) {
  return nearestCollision(r.media, t1, [&](int medium, float end) {
    return sampleFreeFlight(scene.media[medium], r.ray, t0, end, random, spectral...);
  });
}

/// Unbiased estimate of the light that the media of the state add along [t0, t1] [W/(m^2 sr)].
VIRGA_HD inline Rgb estimateEmission(const SceneView& scene, const MediaRay& r, float t0, float t1, Pcg32& random) {
  Rgb sum;
  for (int i = 0; i < r.media.count(); ++i)
    sum += estimateEmission(scene.media[r.media.medium(i)], r.ray, t0, t1, random);
  return sum;
}

/// Unbiased estimate of the transmittance along [0, tMax], null boundaries passed; surfaces are not looked at. Where it
/// is not 0, `r.media` is what holds at the end.
template <class Rays>
VIRGA_HD Rgb passMedia(const SceneView& scene, const Rays& rays, MediaRay& r, float tMax, Pcg32& random) {
  Rgb product(1.f);
  walkMedia(scene, rays, r, tMax, [&](float t0, float t1) {
    for (int i = 0; i < r.media.count() && !isBlack(product); ++i)
      product *= estimateTransmittance(scene.media[r.media.medium(i)], r.ray, t0, t1, random);
    return !isBlack(product);
  });
  return product;
}

}  // namespace virga
