// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lights.h"

#include "core/parallel.h"
#include "transport/media_walk.h"

namespace virga {
namespace {

using kernels::octahedral;

/// Direction at (u, v) in [-1, 1]^2 of the octahedral map: the inverse of kernels::octahedral().
Vec3 directionAt(float u, float v) {
  const float z = 1 - std::fabs(u) - std::fabs(v);
  if (z >= 0) return normalize(Vec3(u, v, z));
  return normalize(Vec3(std::copysign(1 - std::fabs(v), u), std::copysign(1 - std::fabs(u), v), z));
}

Vec3 nodeDirection(int column, int row) {
  const auto place = [](int n) { return 2 * static_cast<float>(n) / (DepthTable::kSide - 1) - 1; };
  return directionAt(place(column), place(row));
}

/// How far from a point there are media, as far as the table's directions tell [unit].
float reachOfMedia(const SceneView& view, const EmbreeRays& rays, Vec3 p, const MediaState& media) {
  const float most = length(max(abs(view.bounds.lo - p), abs(view.bounds.hi - p)));
  float reach = 1e-3f * most;
  for (int row = 0; row < DepthTable::kSide; ++row)
    for (int column = 0; column < DepthTable::kSide; ++column) {
      MediaRay r{{p, nodeDirection(column, row)}, media, 0};
      walkMedia(view, rays, r, most, [&](float, float t1) {
        if (!r.media.vacuum()) reach = std::max(reach, t1);
        return true;
      });
    }
  return reach;
}

/// Everything outside the surfaces is in the same media: the camera's.
bool sameMediaEverywhere(const SceneView& view) {
  return view.boundaries.size == 0 && std::none_of(view.surfaces.begin(), view.surfaces.end(), [](const ShapeView& s) {
           return s.media.declared();
         });
}

/// Adds to depth[m] the optical depth between the radii m - 1 and m of a table.
void addInterval(const SceneView& view, const MediaState& media, const Ray& ray, float t0, float t1, float reach,
                 Rgb depth[DepthTable::kRadii]) {
  constexpr float kIntervals = DepthTable::kRadii - 1;
  const auto radius = [&](int m) { return reach * square(static_cast<float>(m) / kIntervals); };
  const int first = static_cast<int>(std::sqrt(clamp(t0 / reach, 0, 1)) * kIntervals);
  for (int m = std::max(first, 0); m < DepthTable::kRadii - 1 && radius(m) < t1; ++m) {
    const float a = std::max(t0, radius(m)), b = std::min(t1, radius(m + 1));
    if (!(a < b)) continue;
    const Vec3 p = ray.at(0.5f * (a + b));
    for (int i = 0; i < media.count(); ++i) depth[m + 1] += view.media[media.medium(i)].sigmaTAt(p) * (b - a);
  }
}

}  // namespace

bool plainPhase(const PhaseFunction& phase, EndKind& kind, float& g) {
  g = 0;
  kind = EndKind::isotropic;
  if (const auto* hg = phase.get<HenyeyGreenstein>()) {
    g = hg->g;
    if (g != 0) kind = EndKind::henyeyGreenstein;
    return true;
  }
  return phase.get<Isotropic>() != nullptr;
}

FrameLights::FrameLights(const Scene& scene, VirtualLights lights, const std::stop_token& stop)
    : virtualLights_(std::move(lights)), channels_(scene.view.chromatic ? 3 : 1) {
  const SceneView& view = scene.view;
  const float share = 1 / static_cast<float>(virtualLights_.walks());
  for (const VertexKind kind : {VertexKind::surface, VertexKind::medium})
    for (const LightVertex& v : virtualLights_.lights) {
      if (v.kind != kind) continue;
      const bool onSurface = kind == VertexKind::surface;
      Light light{{}, EndKind::lambertian, &v, v.surface < 0};
      float g = 0;
      if (!onSurface) light.plain = plainPhase(view.media[v.medium].phaseAt(v.p), light.kind, g);
      const Vec3 axis = onSurface ? v.normal : v.wi;
      const Rgb weight = v.weight * share;
      light.kernel = {v.p.x, v.p.y, v.p.z, axis.x, axis.y, axis.z, weight.r, weight.g, weight.b, g};
      lights_.push_back(light);
    }
  if (view.media.size == 0) return;
  between_ = Between::media;
  if (sameMediaEverywhere(view)) {
    between_ = Between::fog;
    const MediaState& media = view.cameraMedia;
    for (int i = 0; i < media.count(); ++i) {
      const MediumView& medium = view.media[media.medium(i)];
      if (!medium.homogeneous) between_ = Between::media;
      fog_ += medium.spectrum * medium.sigmaT;
    }
    if (media.vacuum()) between_ = Between::nothing;
  }
  if (between_ == Between::media) makeTables(scene, stop);
}

void FrameLights::makeTables(const Scene& scene, const std::stop_token& stop) {
  depth_.resize(lights_.size() * static_cast<size_t>(channels_) * DepthTable::kSize);
  reach_.resize(lights_.size());
  parallelFor(static_cast<int64_t>(lights_.size()), 8, [&](int64_t i) {
    if (!stop.stop_requested()) fillTable(scene, static_cast<size_t>(i));
  });
}

void FrameLights::fillTable(const Scene& scene, size_t i) {
  const SceneView& view = scene.view;
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const LightVertex& v = *lights_[i].vertex;
  const Vec3 p = v.p + v.normal * (1e-4f * view.scale);
  const MediaState media = mediaAt(scene, p, endlessMedium(scene));
  const float reach = reach_[i] = reachOfMedia(view, rays, p, media);
  float* table = &depth_[i * static_cast<size_t>(channels_) * DepthTable::kSize];
  for (int row = 0; row < DepthTable::kSide; ++row)
    for (int column = 0; column < DepthTable::kSide; ++column, table += DepthTable::kRadii) {
      MediaRay r{{p, nodeDirection(column, row)}, media, 0};
      Rgb depth[DepthTable::kRadii];
      walkMedia(view, rays, r, reach, [&](float t0, float t1) {
        if (!r.media.vacuum()) addInterval(view, r.media, r.ray, t0, t1, reach, depth);
        return true;
      });
      for (int m = 1; m < DepthTable::kRadii; ++m) depth[m] += depth[m - 1];
      for (int m = 0; m < DepthTable::kRadii; ++m) {
        table[m] = depth[m].r;
        if (channels_ == 3) table[m + DepthTable::kSize] = depth[m].g, table[m + 2 * DepthTable::kSize] = depth[m].b;
      }
    }
}

void FrameLights::lookFrom(size_t i, const KernelReceivers& to, float* seen[3]) const {
  const KernelLight& light = lights_[i].kernel;
  for (int c = 0; c < 3; ++c) {
    if (c >= channels_) {
      seen[c] = seen[0];
      continue;
    }
    if (between_ == Between::fog) {
      lookThroughFog(light, to, fog_[c], seen[c]);
      continue;
    }
    std::fill_n(seen[c], to.count, 1.f);
    if (between_ != Between::media) continue;
    const size_t table = i * static_cast<size_t>(channels_) + static_cast<size_t>(c);
    lookThroughTable(light, to, {&depth_[table * DepthTable::kSize], reach_[i]}, seen[c]);
  }
}

}  // namespace virga
