// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/path_tracer.h"
#include "transport/virtual_lights.h"

namespace virga {

struct GatherOptions {
  float bound = 0;    ///< b of the clamped geometry term [1/unit^2], > 0
  int lights = 4;     ///< virtual lights that light a vertex
  int maxDepth = -1;  ///< of whole paths, in segments; -1: no limit
};

/// Light of virtual lights at a vertex of an eye path: equation 8 of the paper with the clamped term min(G, b).
template <class Rays>
class Gatherer {
 public:
  using Path = typename PathTracer<Rays>::Path;
  using Record = typename PathTracer<Rays>::Record;

  VIRGA_HD Gatherer(const SceneView& scene, const Rays& rays, const VirtualLights& lights, const GatherOptions& options)
      : scene_(scene), rays_(rays), lights_(lights), options_(options) {}

  /// Adds to the path's radiance. `at` is the last vertex of its layers; `events` is how many came before it.
  VIRGA_HD void gather(const Record& at, int events, Path& path, Sampler& sampler) const {
    const auto all = static_cast<float>(lights_.lights.size());
    if (!(all > 0)) return;
    const auto count = static_cast<float>(options_.lights);
    const float share = all / (count * static_cast<float>(lights_.walks()));
    const float start = sampler.random();
    for (int j = 0; j < options_.lights; ++j) {
      const float place = (static_cast<float>(j) + start) / count * all;
      const LightVertex& light = lights_.lights[std::min(static_cast<size_t>(place), lights_.lights.size() - 1)];
      if (options_.maxDepth >= 0 && events + 2 + light.depth > options_.maxDepth) continue;
      const Rgb found = from(light, at, sampler);
      if (isBlack(found)) continue;
      LayerPath layers = path.layers;
      layers.scatter(light.kind);
      path.radiance.add(layers.layer(), found * share);
    }
  }

 private:
  /// What one walk's light adds, as if there were no other walks.
  VIRGA_HD Rgb from(const LightVertex& light, const Record& at, Sampler& sampler) const {
    const Vertex& x = at.vertex;
    const Vec3 way = light.p - x.p;
    const float d2 = lengthSquared(way);
    if (!(d2 > 0)) return {};
    const Vec3 w = way / std::sqrt(d2);
    const float cosine = generalCosine(light.normal, w), g = cosine * generalCosine(x.normal(), w) / d2;
    if (!(g > 0)) return {};
    // The vertex's own cosine is in its scattering: for shading normals it differs from that of the geometry.
    const float clamped = cosine / d2 * std::min(1.f, options_.bound / g);
    const Rgb value = at.throughput * x.scattering(w).value * emitted(light, -w) * clamped;
    if (isBlack(value)) return {};
    ConnectingRay ray = aimAt(scene_, x.leave(scene_, w), light.p);
    if (rays_.occluded(ray.at.ray, ray.tMax)) return {};
    return value * passMedia(scene_, rays_, ray.at, ray.tMax, sampler.stream());
  }
  /// Intensity toward w, the cosine at a surface left out [W/sr].
  VIRGA_HD Rgb emitted(const LightVertex& light, Vec3 w) const {
    if (light.kind == VertexKind::surface)
      return light.weight * lights_.surfaces[static_cast<size_t>(light.surface)].scattering(w, light.wi).value;
    return light.weight * scene_.media[light.medium].phaseAt(light.p).value(w, light.wi);
  }

  const SceneView& scene_;
  const Rays& rays_;
  const VirtualLights& lights_;
  const GatherOptions& options_;
};

}  // namespace virga
