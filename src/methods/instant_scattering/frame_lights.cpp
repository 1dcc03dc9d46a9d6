// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lights.h"

#include <bit>

#include "core/octahedral.h"
#include "core/parallel.h"
#include "methods/instant_scattering/light_visibility.h"
#include "transport/media_walk.h"

namespace virga {
namespace {

/// A light's place, a little off its surface.
Vec3 aside(const FrameLights::Light& light, const SceneView& view) {
  return light.vertex->p + light.vertex->normal * mapOffset(view);
}

/// Of a node of the table, in the world.
Vec3 nodeDirection(const DepthView& f, int column, int row) {
  const auto place = [](int n) { return 2 * static_cast<float>(n) / (DepthTable::kSide - 1) - 1; };
  const Vec3 stretched = fromOctahedron({place(column), place(row)});
  const float c = 1 - (1 - stretched.z) / f.stretch;
  const float turned =
      std::sqrt(std::max(0.f, 1 - c * c) / std::max(1e-20f, square(stretched.x) + square(stretched.y)));
  return Vec3(f.ux, f.uy, f.uz) * (stretched.x * turned) + Vec3(f.vx, f.vy, f.vz) * (stretched.y * turned) +
         Vec3(f.wx, f.wy, f.wz) * c;
}

/// Calls visit(t0, t1, ray) for stretches of media along a ray from p, but for where grids hold nothing.
template <class Visit>
void visitStretches(const SceneView& view, const EmbreeRays& rays, MediaRay r, float tMax, const Visit& visit) {
  walkMedia(view, rays, r, tMax, [&](float t0, float t1) {
    for (int i = 0; i < r.media.count(); ++i) {
      const MediumView& medium = view.media[r.media.medium(i)];
      ClippedRange in{t0, t1};
      if (!medium.homogeneous && !(medium.density.background > 0))
        in = clipToBox(medium.worldToDensity.point(r.ray.o), medium.worldToDensity.vector(r.ray.d),
                       medium.density.supportLo, medium.density.supportHi, t0, t1);
      if (in.t0 < in.t1) visit(in.t0, in.t1, r);
    }
    return true;
  });
}

/// All of the scene that holds media, as far as rays from a few of the lights tell.
Bounds boundsOfMedia(const Scene& scene, const std::vector<FrameLights::Light>& lights) {
  constexpr size_t kMost = 64;
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const int endless = endlessMedium(scene);
  const DepthView around{1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1};
  // Media without end, and no shapes among them: as far as may matter.
  const float most = scene.view.bounds.empty() ? 1e3f : 2 * length(scene.view.bounds.extent());
  Bounds media;
  for (size_t i = 0; i < lights.size(); i += std::max<size_t>(1, lights.size() / kMost)) {
    const Vec3 p = aside(lights[i], scene.view);
    const MediaState state = mediaAt(scene, p, endless);
    for (int n = 0; n < DepthTable::kSide * DepthTable::kSide; ++n) {
      const Vec3 d = nodeDirection(around, n % DepthTable::kSide, n / DepthTable::kSide);
      visitStretches(scene.view, rays, {{p, d}, state, 0}, most, [&](float t0, float t1, const MediaRay& r) {
        media.extend(r.ray.at(t0)), media.extend(r.ray.at(t1));
      });
    }
  }
  return media;
}

DepthView viewOf(const Bounds& media, Vec3 p) {
  const Vec3 way = media.center() - p;
  const float radius = 0.5f * length(media.extent()), d = length(way);
  if (!(d > 1.001f * radius)) return {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, d + radius};
  const Frame frame(way / d);
  const float height = std::max(1e-7f, square(radius / d) / (1 + std::sqrt(1 - square(radius / d))));  // 1 - cosine
  return {frame.s.x, frame.s.y, frame.s.z, frame.t.x,  frame.t.y,  frame.t.z,
          frame.n.x, frame.n.y, frame.n.z, 2 / height, d - radius, d + radius};
}

/// Everything outside the surfaces is in the same media: the camera's.
bool sameMediaEverywhere(const SceneView& view) {
  return view.boundaries.size == 0 && std::none_of(view.surfaces.begin(), view.surfaces.end(),
                                                   [](const ShapeView& s) { return s.media.declared(); });
}

/// Adds to depth[m] the optical depth between the radii m - 1 and m of a table.
void addStretch(const SceneView& view, const MediaState& media, const Ray& ray, float t0, float t1, const DepthView& f,
                Rgb depth[DepthTable::kRadii]) {
  constexpr float kIntervals = DepthTable::kRadii - 1;
  const auto radius = [&](int m) { return f.first + (f.last - f.first) * square(static_cast<float>(m) / kIntervals); };
  for (int m = 0; m < DepthTable::kRadii - 1 && radius(m) < t1; ++m) {
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
  inMedia =
      thinned(std::move(inMedia), std::max<size_t>(1, most - std::min(most - 1, onSurfaces.size())), options.turn);
  lights_ = std::move(onSurfaces);
  lights_.insert(lights_.end(), inMedia.begin(), inMedia.end());
  if (options.shadows == ShadowMapping::maps) makeMaps(scene, options, stop);
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

void FrameLights::makeTables(const Scene& scene, const std::stop_token& stop) {
  const Bounds media = boundsOfMedia(scene, lights_);
  if (media.empty()) {
    between_ = Between::nothing;
    return;
  }
  depth_.resize(lights_.size() * static_cast<size_t>(channels_) * DepthTable::kSize);
  for (const Light& light : lights_) views_.push_back(viewOf(media, aside(light, scene.view)));
  parallelFor(static_cast<int64_t>(lights_.size()), 8, [&](int64_t i) {
    if (!stop.stop_requested()) fillTable(scene, static_cast<size_t>(i));
  });
}

void FrameLights::fillTable(const Scene& scene, size_t i) {
  const SceneView& view = scene.view;
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const Vec3 p = aside(lights_[i], view);
  const MediaState media = mediaAt(scene, p, endlessMedium(scene));
  float* table = &depth_[i * static_cast<size_t>(channels_) * DepthTable::kSize];
  for (int row = 0; row < DepthTable::kSide; ++row)
    for (int column = 0; column < DepthTable::kSide; ++column, table += DepthTable::kRadii) {
      MediaRay r{{p, nodeDirection(views_[i], column, row)}, media, 0};
      Rgb depth[DepthTable::kRadii];
      walkMedia(view, rays, r, views_[i].last, [&](float t0, float t1) {
        if (!r.media.vacuum()) addStretch(view, r.media, r.ray, t0, t1, views_[i], depth);
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
      lookThroughTable(light, to, {&depth_[table * DepthTable::kSize], views_[i]}, seen[c]);
    if (maps_.empty()) continue;
    lookThroughMap(light, to, kind,
                   {&maps_[i * texelsOfMap()], mapSide_, ShadowMapsView::kBias * 2 / static_cast<float>(mapSide_),
                    ShadowMapsView::kLeastCosine},
                   seen[c]);
  }
}

}  // namespace virga
