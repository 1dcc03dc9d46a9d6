// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/gather.h"
#include "methods/instant_scattering/nearby_vertex.h"

namespace virga {

/// How the light that clamping takes from the virtual lights is found again.
struct CompensationOptions {
  /// Beyond the last level: nothing; virtual lights with a bound that is kReducedClamping times as high; virtual lights
  /// without any.
  enum class Ending { nothing, reduced, unclamped };
  /// To the new vertices: the true one; exp(-s t) with the local mean s in its place; this where extinction hardly
  /// changes on the way, else the true one.
  enum class Transmittance { exact, mean, gradient };
  static constexpr float kReducedClamping = 16;

  float radius = 0;  ///< [unit] 1 / sqrt(bound): clamping takes nothing from farther away
  int levels = -1;   ///< of recursion; -1: until Russian roulette ends it
  Ending ending = Ending::unclamped;
  int vertices[2] = {1, 1};  ///< V_1, and V_2 for all deeper levels
  GatherAmount amounts[2];   ///< P_1 and P_2: what lights each of these
  Transmittance transmittance = Transmittance::exact;
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

  VIRGA_HD Compensation(const SceneView& scene, const Rays& rays, const Tracer& tracer, const Gatherer<Rays>& gatherer,
                        const CompensationOptions& options)
      : scene_(scene), rays_(rays), tracer_(tracer), gatherer_(gatherer), options_(options) {}

  /// Adds to `radiance` what clamping has taken at a vertex. `layers` ends with it; `events` came before it; `known` is
  /// what gathering there has told about the surfaces around.
  VIRGA_HD void compensate(const Record& at, const KnownSpace& known, const LayerPath& layers, int events,
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
  VIRGA_HD void light(const Record& at, const LayerPath& layers, int events, LayerRadiance& radiance, Sampler& sampler,
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
  VIRGA_HD void gather(const Record& at, Path& path, int events, Sampler& sampler, int level) const {
    const bool last = options_.levels >= 0 && level >= options_.levels;
    const KnownSpace known = gatherer_.gather(at, events, path, options_.amounts[level > 1],
                                              last ? lastBound() : gatherer_.bound(), sampler);
    compensate(at, known, path.layers, events, path.radiance, sampler, level + 1);
  }
  VIRGA_HD float lastBound() const {
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
  VIRGA_HD bool findVertex(const Record& at, const KnownSpace& known, Record& next, Sampler& sampler) const {
    const NearbyVertex<Rays> nearby{scene_, rays_, options_.radius, gatherer_.bound()};
    const NearbyNumbers numbers{sampler.random2D(), sampler.random(), sampler.random2D(), sampler.random()};
    const auto isFree = [&](Vec3 w, float t) { return gatherer_.isFree(known, at.vertex.p, w, t); };
    const auto seen = [&](MediaRay& r, float end, float localMean) {
      return transmittance(r, end, localMean, sampler);
    };
    return nearby.find(at.vertex, at.throughput, numbers, isFree, seen, next.vertex, next.throughput);
  }

  /// Section 4.4 of the paper names both: the local mean in place of the way, and the gradient of sigma_t to find where
  /// that fails.
  VIRGA_HD Rgb transmittance(MediaRay& r, float end, float localMean, Sampler& sampler) const {
    using Choice = CompensationOptions::Transmittance;
    if (options_.transmittance == Choice::exact) return passMedia(scene_, rays_, r, end, sampler.stream());
    MediaRay atEnd = r;
    walkMedia(scene_, rays_, atEnd, end, [](float, float) { return true; });
    if (options_.transmittance == Choice::gradient && changes(atEnd, end, localMean))
      return passMedia(scene_, rays_, r, end, sampler.stream());
    r = atEnd;
    return Rgb(std::exp(-localMean * end));
  }
  /// The gradient along the way is (sigma_t at its end - s) / t; over t it makes the optical depth wrong by t^2 / 2 of
  /// that.
  VIRGA_HD bool changes(const MediaRay& atEnd, float t, float s) const {
    Rgb sigmaT;
    for (int i = 0; i < atEnd.media.count(); ++i)
      sigmaT += scene_.media[atEnd.media.medium(i)].sigmaTAt(atEnd.ray.at(t));
    return std::fmax(maxComponent(sigmaT) - s, s - minComponent(sigmaT)) * t / 2 > kWrongDepth;
  }
  static constexpr float kWrongDepth = 0.02f;

  const SceneView& scene_;
  const Rays& rays_;
  const Tracer& tracer_;
  const Gatherer<Rays>& gatherer_;
  const CompensationOptions& options_;
};

}  // namespace virga
