// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/gather.h"
#include "methods/instant_scattering/restricted_distance.h"

namespace virga {

/// How the light that clamping takes from the virtual lights is found again.
struct CompensationOptions {
  /// Beyond the last level: nothing; virtual lights with a bound that is kReducedClamping times as high; virtual lights
  /// without any.
  enum class Ending { nothing, reduced, unclamped };
  static constexpr float kReducedClamping = 16;

  float radius = 0;  ///< [unit] 1 / sqrt(bound): clamping takes nothing from farther away
  int levels = -1;   ///< of recursion; -1: until Russian roulette ends it
  Ending ending = Ending::unclamped;
  int vertices[2] = {1, 1};             ///< V_1, and V_2 for all deeper levels
  GatherAmount amounts[2];              ///< P_1 and P_2: what lights each of these
  bool localMeanTransmittance = false;  ///< exp(-s t) with the local mean s in place of the true one
};

/// The recursive bias compensation of the paper (section 4.4): near a vertex x new vertices x' are sampled, with
/// distances from a density restricted to the clamping radius, and what they scatter toward x counts by
/// max(0, G - b) / G. Unbiased unless an option says otherwise.
template <class Rays>
class Compensation {
 public:
  using Tracer = PathTracer<Rays>;
  using Path = typename Tracer::Path;
  using Record = typename Tracer::Record;

  Compensation(const SceneView& scene, const Rays& rays, const Tracer& tracer, const Gatherer<Rays>& gatherer,
               const CompensationOptions& options)
      : scene_(scene), rays_(rays), tracer_(tracer), gatherer_(gatherer), options_(options) {}

  /// Adds to `radiance` what clamping has taken at a vertex. `layers` ends with it; `events` came before it; `known` is
  /// what gathering there has told about the surfaces around.
  void compensate(const Record& at, const KnownSpace& known, const LayerPath& layers, int events,
                  LayerRadiance& radiance, Sampler& sampler, int level = 1) const {
    if (options_.levels >= 0 && level > options_.levels) return;
    const int count = options_.vertices[level > 1];
    for (int i = 0; i < count; ++i) {
      Record next;
      if (!findVertex(at, known, next, sampler)) continue;
      next.throughput *= 1 / static_cast<float>(count);
      // As many go on as the light they bring is worth; from the third level on that is less than one in all, or
      // recursion in dense media would never end.
      const float kept = level <= 2 ? static_cast<float>(count) : 1;
      const float q = std::min(1.f, maxComponent(next.throughput) * kept / maxComponent(at.throughput));
      if (!(sampler.random() < q)) continue;
      next.throughput *= 1 / q;
      light(next, layers, events + 1, radiance, sampler, level);
    }
  }

 private:
  /// All light that x' scatters: straight from lamps, through specular vertices, and that of virtual lights.
  void light(const Record& at, const LayerPath& layers, int events, LayerRadiance& radiance, Sampler& sampler,
             int level) const {
    if (!tracer_.mayScatter(events)) return;
    Path path;
    path.layers = layers;
    path.depth = events;
    path.throughput = at.throughput;
    path.bound = kInfinity;  // of what is linked to virtual lights nothing is left to the path
    Record record;
    path.record = &record;
    bool goesOn = tracer_.scatterAt(path, at.vertex, sampler);
    gather(at, path, events, sampler, level);
    while (goesOn) {
      record.vertex.kind = VertexKind::none;
      const int before = path.depth;
      goesOn = tracer_.extend(path, sampler);
      if (record.vertex.kind != VertexKind::none) gather(record, path, before, sampler, level);
    }
    radiance += path.radiance;
  }
  void gather(const Record& at, Path& path, int events, Sampler& sampler, int level) const {
    const bool last = options_.levels >= 0 && level >= options_.levels;
    const KnownSpace known = gatherer_.gather(at, events, path, options_.amounts[level > 1],
                                              last ? lastBound() : gatherer_.bound(), sampler);
    compensate(at, known, path.layers, events, path.radiance, sampler, level + 1);
  }
  float lastBound() const {
    switch (options_.ending) {
      case CompensationOptions::Ending::nothing:
        return gatherer_.bound();
      case CompensationOptions::Ending::reduced:
        return gatherer_.bound() * CompensationOptions::kReducedClamping;
      default:
        return kInfinity;
    }
  }

  /// x' and the throughput to it; false where there is nothing.
  bool findVertex(const Record& at, const KnownSpace& known, Record& next, Sampler& sampler) const {
    const Vertex& x = at.vertex;
    const auto direction = x.sample(sampler.random2D(), sampler.random());
    if (!(direction.pdf > 0)) return false;
    MediaRay r = x.leave(scene_, direction.wi);
    const RestrictedDistance distances{localMean(r.media, x.p), options_.radius};
    const float t = distances.sample(sampler.random2D());
    const RayHit hit = gatherer_.isFree(known, x.p, direction.wi, t) ? RayHit{} : rays_.nearest(r.ray, options_.radius);
    const bool onSurface = hit.found() && hit.t < t;
    const float end = onSurface ? hit.t : t;
    const float density = onSurface ? distances.beyond(hit.t) : distances.pdf(t);
    if (!(density > 0)) return false;
    const Rgb exact = passMedia(scene_, rays_, r, end, sampler.stream());
    const Rgb seen = options_.localMeanTransmittance ? Rgb(std::exp(-distances.s * end)) : exact;
    next.throughput = at.throughput * direction.weight * seen / density;
    if (isBlack(next.throughput) || isBlack(exact)) return false;
    if (!(onSurface ? placeOnSurface(hit, r, next) : placeInMedium(r, t, next, sampler))) return false;
    const float g = geometryTerm(x.p, x.normal(), next.vertex.p, next.vertex.normal());
    next.throughput *= clampedShareOf(g, gatherer_.bound());
    return !isBlack(next.throughput);
  }
  bool placeInMedium(const MediaRay& r, float t, Record& next, Sampler& sampler) const {
    const Vec3 p = r.ray.at(t);
    float sum = 0;
    for (int i = 0; i < r.media.count(); ++i) sum += mean(scene_.media[r.media.medium(i)].sigmaTAt(p));
    if (!(sum > 0)) return false;
    float u = sampler.random() * sum;
    int chosen = -1;
    Rgb sigmaT;
    for (int i = 0; i < r.media.count() && u >= 0; ++i) {
      const Rgb here = scene_.media[r.media.medium(i)].sigmaTAt(p);
      if (!(mean(here) > 0)) continue;
      chosen = r.media.medium(i), sigmaT = here;
      u -= mean(here);
    }
    next.throughput *= sigmaT * (sum / mean(sigmaT));
    next.vertex = Vertex::inMedium(scene_, chosen, p, -r.ray.d, r.media);
    return true;
  }
  /// Only where virtual lights may stand.
  bool placeOnSurface(const RayHit& hit, const MediaRay& r, Record& next) const {
    const SurfacePoint point = surfacePoint(scene_.surfaces[hit.shape], r.ray, hit, scene_.scale);
    Bsdf textured;
    const Side side = sideOf(scene_, point, hit, -r.ray.d, textured);
    if (!side.bsdf->broad() || side.leaks(-r.ray.d, side.wo)) return false;
    next.vertex = Vertex::onSurface(point, side, -r.ray.d, r.media);
    return true;
  }

  /// Mean extinction about a point, of all channels, from the downsampled grids [1/unit].
  float localMean(const MediaState& media, Vec3 p) const {
    float s = 0;
    for (int i = 0; i < media.count(); ++i) s += scene_.media[media.medium(i)].localMeanSigmaT(p);
    return s;
  }

  const SceneView& scene_;
  const Rays& rays_;
  const Tracer& tracer_;
  const Gatherer<Rays>& gatherer_;
  const CompensationOptions& options_;
};

}  // namespace virga
