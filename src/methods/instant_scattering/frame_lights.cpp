// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lights.h"

#include <bit>

#include "core/parallel.h"
#include "methods/instant_scattering/light_visibility.h"
#include "transport/media_walk.h"

namespace virga {
namespace {

/// A light's place, a little off its surface.
Vec3 aside(const FrameLights::Light& light, const SceneView& view) {
  return light.vertex->p + light.vertex->normal * mapOffset(view);
}

FrameLights::Light lightOf(const SceneView& view, const LightVertex& v, int walks) {
  const bool onSurface = v.kind == VertexKind::surface;
  FrameLights::Light light{{}, EndKind::lambertian, &v, 1 / static_cast<float>(walks), v.surface < 0};
  float g = 0;
  if (!onSurface) light.plain = plainPhase(view.media[v.medium].phaseAt(v.p), light.kind, g);
  const Vec3 axis = onSurface ? v.normal : v.wi;
  const Rgb weight = v.weight * light.share;
  light.kernel = {v.p.x, v.p.y, v.p.z, axis.x, axis.y, axis.z, weight.r, weight.g, weight.b, g};
  return light;
}

Vec3 positionOf(const FrameLights::Light& l) { return {l.kernel.px, l.kernel.py, l.kernel.pz}; }

/// A place on a curve that fills the box (Morton 1966): neighbours on it are neighbours in space.
uint64_t placeOnCurve(Vec3 p, const Bounds& box) {
  constexpr int kBits = 12;
  uint64_t code = 0;
  uint32_t cell[3];
  for (int axis = 0; axis < 3; ++axis) {
    const float extent = box.extent()[axis];
    const float share = extent > 0 ? (p[axis] - box.lo[axis]) / extent : 0;
    cell[axis] = static_cast<uint32_t>(clamp(share, 0, 1) * ((1 << kBits) - 1));
  }
  for (int bit = kBits - 1; bit >= 0; --bit)
    for (const uint32_t c : cell) code = code << 1 | (c >> bit & 1u);
  return code;
}

/// About `most` of the lights, those at even steps of their summed weights along the curve.
std::vector<FrameLights::Light> thinned(std::vector<FrameLights::Light> all, size_t most, float turn) {
  if (all.size() <= most) return all;
  Bounds box;
  for (const auto& l : all) box.extend(positionOf(l));
  std::vector<std::pair<uint64_t, size_t>> order;
  for (size_t i = 0; i < all.size(); ++i) order.emplace_back(placeOnCurve(positionOf(all[i]), box), i);
  std::sort(order.begin(), order.end());
  const auto weightOf = [](const FrameLights::Light& l) {
    return static_cast<double>(std::max(l.kernel.r, std::max(l.kernel.g, l.kernel.b)));
  };
  double total = 0;
  for (const auto& l : all) total += weightOf(l);
  const double step = total / static_cast<double>(most);
  std::vector<FrameLights::Light> kept;
  double sum = 0, next = step * static_cast<double>(turn);
  for (const auto& [place, i] : order) {
    const double weight = weightOf(all[i]);
    sum += weight;
    if (!(next < sum)) continue;
    double stands = 0;
    for (; next < sum; next += step) stands += step;
    const auto scale = static_cast<float>(stands / weight);
    FrameLights::Light l = all[i];
    l.kernel.r *= scale, l.kernel.g *= scale, l.kernel.b *= scale, l.share *= scale;
    kept.push_back(l);
  }
  return kept;
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

FrameLights::FrameLights(const Scene& scene, VirtualLights lights, const Options& options, const std::stop_token& stop)
    : virtualLights_(std::move(lights)) {
  const SceneView& view = scene.view;
  std::vector<Light> onSurfaces, inMedia;
  for (const LightVertex& v : virtualLights_.lights)
    (v.kind == VertexKind::surface ? onSurfaces : inMedia).push_back(lightOf(view, v, virtualLights_.walks()));
  const auto most = static_cast<size_t>(options.most);
  const size_t surfaceShare = std::max(most / 2, most - std::min(most, inMedia.size()));
  onSurfaces = thinned(std::move(onSurfaces), surfaceShare, options.turn);
  inMedia =
      thinned(std::move(inMedia), std::max<size_t>(1, most - std::min(most - 1, onSurfaces.size())), options.turn);
  lights_ = std::move(onSurfaces);
  lights_.insert(lights_.end(), inMedia.begin(), inMedia.end());
  if (options.shadows == ShadowMapping::maps) makeMaps(scene, options, stop);
  std::vector<Vec3> places;
  for (const Light& l : lights_) places.push_back(aside(l, view));
  between_ = MediaBetween(scene, std::move(places), {}, stop);
}

float FrameLights::spacing() const {
  const bool anyInMedia = !lights_.empty() && lights_.back().vertex->kind == VertexKind::medium;
  std::vector<float> along[3];
  for (const Light& l : lights_) {
    if (anyInMedia && l.vertex->kind != VertexKind::medium) continue;
    for (int axis = 0; axis < 3; ++axis) along[axis].push_back(positionOf(l)[axis]);
  }
  if (along[0].empty()) return 1;
  const auto count = static_cast<float>(along[0].size());
  float volume = 1;
  for (std::vector<float>& a : along) {
    std::sort(a.begin(), a.end());
    volume *= a[a.size() * 19 / 20] - a[a.size() / 20];  // a few stray far
  }
  return std::cbrt(volume / count);
}

void FrameLights::makeMaps(const Scene& scene, const Options& options, const std::stop_token& stop) {
  refuseTooManyMaps(lights_.size(), options.resolution, "lights");
  std::vector<LightVertex> vertices;
  for (const Light& l : lights_) vertices.push_back(*l.vertex);
  const ShadowMapOptions map{.resolution = options.resolution};
  const ShadowMaps maps = options.points > 0
                              ? ShadowMaps(SurfacePoints(scene.view, options.points, 0), vertices, map, stop)
                              : ShadowMaps(*scene.surfaceRays, mapOffset(scene.view), vertices, map, stop);
  mapSide_ = options.resolution;
  maps_.resize(lights_.size() * texelsOfMap());
  // In floats: no vector code gathers halves of words.
  parallelFor(static_cast<int64_t>(lights_.size()), 1, [&](int64_t light) {
    const size_t first = static_cast<size_t>(light) * texelsOfMap();
    for (size_t i = first; i < first + texelsOfMap(); ++i)
      maps_[i] = std::bit_cast<float>(static_cast<uint32_t>(maps.view().depths[i]) << 16);
  });
}

KernelShadowMap FrameLights::mapOf(size_t i) const {
  return {&maps_[i * texelsOfMap()], mapSide_, ShadowMapsView::kBias * 2 / static_cast<float>(mapSide_),
          ShadowMapsView::kLeastCosine};
}

bool FrameLights::gatherAtOnce(size_t i, const KernelReceivers& to, EndKind kind, const NearField& near) const {
  if (!between_.grey() || maps_.empty()) return false;
  const Light& light = lights_[i];
  const bool looksUp = between_.kind() == MediaBetween::Kind::tables;
  const DepthTable table = looksUp ? between_.table(i, 0) : DepthTable{};
  gatherThrough(light.kernel, light.kind, to, kind, looksUp ? &table : nullptr, between_.fog().r, mapOf(i), near);
  return true;
}

void FrameLights::lookFrom(size_t i, const KernelReceivers& to, EndKind kind, float* seen[3]) const {
  const KernelLight& light = lights_[i].kernel;
  between_.look(i, to, seen);
  if (maps_.empty()) return;
  const KernelShadowMap map = mapOf(i);
  lookThroughMap(light, to, kind, map, seen[0]);
  for (int c = 1; c < 3; ++c)
    if (seen[c] != seen[0]) lookThroughMap(light, to, kind, map, seen[c]);
}

}  // namespace virga
