// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/restricted_distance.h"
#include "transport/visibility.h"

namespace virga {

/// What chooses a new vertex, in [0, 1).
struct NearbyNumbers {
  Vec2 direction;
  float lobe;
  Vec2 distance;
  float medium;
};

/// New vertices x' near a vertex x, which find what clamping has taken from the light at x (section 4.4 of the paper):
/// directions by the scattering at x, distances from a density restricted to the clamping radius.
template <class Rays>
struct NearbyVertex {
  const SceneView& scene;
  const Rays& rays;
  float radius;  ///< [unit]
  float bound;   ///< of the geometry term [1/unit^2]

  /// x' and the throughput to it, max(0, G - b) / G included; false where there is nothing. isFree(w, t): it is known
  /// that no surface lies on the way. seen(ray, t, local mean of sigma_t): transmittance, the ray's media on return
  /// being those at its end.
  template <class IsFree, class Seen>
  VIRGA_HD bool find(const Vertex& x, Rgb throughput, const NearbyNumbers& u, const IsFree& isFree, const Seen& seen,
                     Vertex& next, Rgb& nextThroughput) const {
    const auto direction = x.sample(u.direction, u.lobe);
    if (!(direction.pdf > 0)) return false;
    MediaRay r = x.leave(scene, direction.wi);
    const RestrictedDistance distances{localMean(r.media, x.p), radius};
    const float t = distances.sample(u.distance);
    const RayHit hit = isFree(direction.wi, t) ? RayHit{} : rays.nearest(r.ray, radius);
    const bool onSurface = hit.found() && hit.t < t;
    const float end = onSurface ? hit.t : t;
    const float density = onSurface ? distances.beyond(hit.t) : distances.pdf(t);
    if (!(density > 0)) return false;
    nextThroughput = throughput * direction.weight * seen(r, end, distances.s) / density;
    if (isBlack(nextThroughput)) return false;
    if (!(onSurface ? placeOnSurface(hit, r, next) : placeInMedium(r, t, u.medium, next, nextThroughput))) return false;
    const float g = geometryTerm(x.p, x.normal(), next.p, next.normal());
    nextThroughput *= clampedShareOf(g, bound);
    return !isBlack(nextThroughput);
  }

 private:
  VIRGA_HD bool placeInMedium(const MediaRay& r, float t, float choice, Vertex& next, Rgb& throughput) const {
    const Vec3 p = r.ray.at(t);
    float sum = 0;
    for (int i = 0; i < r.media.count(); ++i) sum += mean(scene.media[r.media.medium(i)].sigmaTAt(p));
    if (!(sum > 0)) return false;
    float u = choice * sum;
    int chosen = -1;
    Rgb sigmaT;
    for (int i = 0; i < r.media.count() && u >= 0; ++i) {
      const Rgb here = scene.media[r.media.medium(i)].sigmaTAt(p);
      if (!(mean(here) > 0)) continue;
      chosen = r.media.medium(i), sigmaT = here;
      u -= mean(here);
    }
    throughput *= sigmaT * (sum / mean(sigmaT));
    next = Vertex::inMedium(scene, chosen, p, -r.ray.d, r.media);
    return true;
  }
  /// Only where virtual lights may stand.
  VIRGA_HD bool placeOnSurface(const RayHit& hit, const MediaRay& r, Vertex& next) const {
    const SurfacePoint point = surfacePoint(scene.surfaces[hit.shape], r.ray, hit, scene.scale);
    Bsdf textured;
    const Side side = sideOf(scene, point, hit, -r.ray.d, textured);
    if (!side.bsdf->broad() || side.leaks(-r.ray.d, side.wo)) return false;
    next = Vertex::onSurface(point, side, -r.ray.d, r.media);
    return true;
  }

  /// Mean extinction about a point, of all channels, from the downsampled grids [1/unit].
  VIRGA_HD float localMean(const MediaState& media, Vec3 p) const {
    float s = 0;
    for (int i = 0; i < media.count(); ++i) s += scene.media[media.medium(i)].localMeanSigmaT(p);
    return s;
  }
};

}  // namespace virga
