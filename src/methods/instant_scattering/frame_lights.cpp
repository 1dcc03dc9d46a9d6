// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lights.h"

#include <bit>

#include "core/octahedral.h"
#include "core/parallel.h"
#include "methods/instant_scattering/shadow_maps.h"
#include "transport/media_walk.h"

namespace virga {
namespace {

/// Smaller maps than a picture of one light would need: there are a thousand of them.
constexpr int kMapResolution = 64, kMapCells = 1000;

Vec3 nodeDirection(int column, int row) {
  const auto place = [](int n) { return 2 * static_cast<float>(n) / (DepthTable::kSide - 1) - 1; };
  return fromOctahedron({place(column), place(row)});
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
    : virtualLights_(std::move(lights)), channels_(scene.view.chromatic ? 3 : 1) {
  const SceneView& view = scene.view;
  std::vector<Light> onSurfaces, inMedia;
  for (const LightVertex& v : virtualLights_.lights)
    (v.kind == VertexKind::surface ? onSurfaces : inMedia).push_back(lightOf(view, v, virtualLights_.walks()));
  const auto most = static_cast<size_t>(options.most);
  const size_t surfaceShare = std::max(most / 2, most - std::min(most, inMedia.size()));
  onSurfaces = thinned(std::move(onSurfaces), surfaceShare, options.turn);
  inMedia = thinned(std::move(inMedia), std::max<size_t>(1, most - std::min(most - 1, onSurfaces.size())), options.turn);
  lights_ = std::move(onSurfaces);
  lights_.insert(lights_.end(), inMedia.begin(), inMedia.end());
  if (options.shadows == ShadowMapping::maps) makeMaps(scene, stop);
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

void FrameLights::makeMaps(const Scene& scene, const std::stop_token& stop) {
  const SurfacePoints points(scene.view, kMapCells, 0);
  std::vector<LightVertex> vertices;
  for (const Light& l : lights_) vertices.push_back(*l.vertex);
  const ShadowMaps maps(points, vertices, {.resolution = kMapResolution}, stop);
  const size_t texels = lights_.size() * kMapResolution * kMapResolution;
  maps_.resize(texels);
  // In floats: no vector code gathers halves of words.
  parallelFor(static_cast<int64_t>(texels / kMapResolution), 64, [&](int64_t row) {
    for (size_t i = static_cast<size_t>(row) * kMapResolution; i < static_cast<size_t>(row + 1) * kMapResolution; ++i)
      maps_[i] = std::bit_cast<float>(static_cast<uint32_t>(maps.view().depths[i]) << 16);
  });
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

void FrameLights::lookFrom(size_t i, const KernelReceivers& to, EndKind kind, float* seen[3]) const {
  const KernelLight& light = lights_[i].kernel;
  for (int c = 0; c < 3; ++c) {
    if (c >= channels_) {
      seen[c] = seen[0];
      continue;
    }
    if (between_ == Between::fog)
      lookThroughFog(light, to, fog_[c], seen[c]);
    else
      std::fill_n(seen[c], to.count, 1.f);
    const size_t table = i * static_cast<size_t>(channels_) + static_cast<size_t>(c);
    if (between_ == Between::media)
      lookThroughTable(light, to, {&depth_[table * DepthTable::kSize], reach_[i]}, seen[c]);
    if (maps_.empty()) continue;
    lookThroughMap(light, to, kind,
                   {&maps_[i * kMapResolution * kMapResolution], kMapResolution,
                    ShadowMapsView::kBias * 2 / kMapResolution, ShadowMapsView::kLeastCosine},
                   seen[c]);
  }
}

}  // namespace virga
