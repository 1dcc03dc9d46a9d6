// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/light_visibility.h"
#include "methods/path/path_tracer.h"
#include "transport/virtual_lights_view.h"

namespace virga {

/// How many virtual lights light a vertex: all of those of some walks, or single ones, whatever their walk.
struct GatherAmount {
  int walks = 0;   ///< P; 0: single lights
  int lights = 4;  ///< if single
};

struct GatherOptions {
  float bound = 0;         ///< b of the clamped geometry term [1/unit^2], > 0
  int maxDepth = -1;       ///< of whole paths, in segments; -1: no limit
  bool lostLight = false;  ///< what clamping takes, max(0, G - b), in place of what it leaves
};

/// Light of virtual lights at a vertex of an eye path: equation 8 of the paper with the clamped term min(G, b).
template <class Rays>
class Gatherer {
 public:
  using Path = typename PathTracer<Rays>::Path;
  using Record = typename PathTracer<Rays>::Record;

  VIRGA_HD Gatherer(const SceneView& scene, const Rays& rays, const VirtualLightsView& lights,
                    const LightVisibilityView& visibility, const GatherOptions& options)
      : scene_(scene), rays_(rays), lights_(lights), visibility_(visibility), options_(options) {}

  VIRGA_HD float bound() const { return options_.bound; }

  /// Adds to the path's radiance. `at` is the last vertex of its layers; `events` is how many came before it. Returns
  /// what it has learnt about the surfaces around.
  VIRGA_HD KnownSpace gather(const Record& at, int events, Path& path, const GatherAmount& amount, float bound,
                             Sampler& sampler) const {
    KnownSpace known;
    if (lights_.lights.size == 0) return known;
    const int all = amount.walks > 0 ? lights_.walks() : lights_.lights.size;
    const int count = amount.walks > 0 ? std::min(amount.walks, all) : std::min(amount.lights, all);
    // One of each of as many equal parts of the list: neighbours in it are of one walk.
    const float share = static_cast<float>(all) / static_cast<float>(count) / static_cast<float>(lights_.walks());
    const double start = static_cast<double>(sampler.random());
    const auto pick = [&](int j) {
      const double place = (j + start) / count * all;
      return static_cast<uint32_t>(std::min(static_cast<int>(place), all - 1));
    };
    if (amount.walks == 0)
      for (int j = 0; j < count; ++j) prefetch(&lights_.lights[pick(j)]);
    for (int j = 0; j < count; ++j) {
      const uint32_t i = pick(j);
      if (amount.walks == 0)
        add(i, at, events, path, share, bound, known, sampler);
      else
        for (uint32_t l = lights_.firstOf[i]; l < lights_.firstOf[i + 1]; ++l)
          add(l, at, events, path, share, bound, known, sampler);
    }
    return known;
  }
  /// Is it known that no surface lies between x and a point in a direction w?
  VIRGA_HD bool isFree(const KnownSpace& known, Vec3 x, Vec3 w, float t) const {
    return visibility_.isFree(known, lights_.lights, x + w * t, t);
  }

 private:
  VIRGA_HD void add(uint32_t index, const Record& at, int events, Path& path, float share, float bound,
                    KnownSpace& known, Sampler& sampler) const {
    const LightVertex& light = lights_.lights[index];
    if (options_.maxDepth >= 0 && events + 2 + light.depth > options_.maxDepth) return;
    const Rgb found = from(index, at, bound, known, sampler);
    if (isBlack(found)) return;
    LayerPath layers = path.layers;
    layers.scatter(light.kind);
    path.radiance.add(layers.layer(), found * share);
  }
  /// What one walk's light adds, as if there were no other walks.
  VIRGA_HD Rgb from(uint32_t index, const Record& at, float bound, KnownSpace& known, Sampler& sampler) const {
    const LightVertex& light = lights_.lights[index];
    const Vertex& x = at.vertex;
    const Vec3 way = light.p - x.p;
    const float d2 = lengthSquared(way);
    if (!(d2 > 0)) return {};
    const float d = std::sqrt(d2);
    const Vec3 w = way / d;
    const float cosine = generalCosine(light.normal, w), g = cosine * generalCosine(x.normal(), w) / d2;
    if (!(g > 0)) return {};
    // The vertex's own cosine is in its scattering: for shading normals it differs from that of the geometry.
    const float lost = clampedShareOf(g, bound);
    const float clamped = cosine / d2 * (options_.lostLight ? lost : 1 - lost);
    const Rgb value = at.throughput * x.scattering(w) * intensity(lights_, scene_, light, -w) * clamped;
    if (isBlack(value)) return {};
    ConnectingRay ray = aimAt(scene_, x.leave(scene_, w), light.p);
    if (visibility_.blocked(rays_, ray, x, w, d, index)) return {};
    visibility_.learn(known, light, index, w, d);
    return value * passMedia(scene_, rays_, ray.at, ray.tMax, sampler.stream());
  }

  const SceneView& scene_;
  const Rays& rays_;
  VirtualLightsView lights_;
  LightVisibilityView visibility_;
  const GatherOptions& options_;
};

}  // namespace virga
