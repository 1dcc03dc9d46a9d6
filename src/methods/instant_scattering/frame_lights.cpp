// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_lights.h"

#include "core/parallel.h"
#include "methods/instant_scattering/light_spacing.h"
#include "methods/instant_scattering/light_visibility.h"
#include "transport/media_bounds.h"
#include "transport/media_walk.h"

namespace virga {
namespace {

/// A light's place, a little off its surface.
Vec3 aside(const FrameLights::Light& light, const SceneView& view) {
  return light.vertex->p + light.vertex->normal * mapOffset(view);
}

FrameLights::Light lightOf(const SceneView& view, const LightVertex& v, int walks) {
  const bool onSurface = v.kind == VertexKind::surface;
  FrameLights::Light light{{}, EndKind::lambertian, &v,           1 / static_cast<float>(walks),
                           0,  NearField().core,    v.surface < 0};
  float g = 0;
  if (!onSurface) light.plain = plainPhase(view.media[v.medium].phaseAt(v.p), light.kind, g);
  const Vec3 axis = onSurface ? v.normal : v.wi;
  const Rgb weight = v.weight * light.share;
  light.kernel = {v.p.x, v.p.y, v.p.z, axis.x, axis.y, axis.z, weight.r, weight.g, weight.b, g};
  return light;
}

Vec3 positionOf(const FrameLights::Light& l) { return {l.kernel.px, l.kernel.py, l.kernel.pz}; }
float brightness(const FrameLights::Light& l) { return std::max(l.kernel.r, std::max(l.kernel.g, l.kernel.b)); }

/// Lights of one kind, and by what they are chosen: their walk and the number of the vertex on it are their name.
struct OfKind {
  std::vector<FrameLights::Light> lights;
  std::vector<LightChoice::Candidate> candidates;
};

/// How much the lights count for what can be seen, by how far they are from where things are: in fog without end walks
/// leave lights far out, which hardly shine on anything.
class Nearness {
 public:
  explicit Nearness(const Scene& scene) {
    const SceneView& view = scene.view;
    if (view.surfaces.size + view.boundaries.size > 0) near_ = view.bounds;  // otherwise these are the camera's place
    for (const EmitterView& e : view.emitters)
      if (e.isLocal() && e.isDelta()) near_.extend(e.position);
    for (const Bounds& box : boxesOfMedia(scene, 1, mediumWithoutEnd(scene))) near_.extend(box);
    radius2_ = near_.empty() ? 0 : lengthSquared(near_.extent()) / 4;
  }
  float at(Vec3 p) const {
    const Vec3 beyond = max(max(near_.lo - p, p - near_.hi), Vec3(0.f));
    return radius2_ > 0 ? radius2_ / (radius2_ + lengthSquared(beyond)) : 1;
  }

 private:
  Bounds near_;
  float radius2_;  ///< 0: nothing is known to be near
};

OfKind lightsOf(const SceneView& view, const VirtualLights& all, const Nearness& nearness, VertexKind kind) {
  OfKind found;
  for (size_t walk = 0; walk + 1 < all.firstOf.size(); ++walk)
    for (size_t i = all.firstOf[walk]; i < all.firstOf[walk + 1]; ++i) {
      const LightVertex& v = all.lights[i];
      if (v.kind != kind) continue;
      const FrameLights::Light l = lightOf(view, v, all.walks());
      found.lights.push_back(l);
      found.candidates.push_back(
          {static_cast<uint64_t>(walk) << 32 | static_cast<uint32_t>(v.depth), v.p, brightness(l) * nearness.at(v.p)});
    }
  return found;
}

std::vector<FrameLights::Light> chosenOf(const OfKind& all, LightChoice& choice, size_t most, float turn) {
  std::vector<FrameLights::Light> chosen;
  for (const auto& [i, scale] : choice.choose(all.candidates, most, turn)) {
    FrameLights::Light l = all.lights[i];
    l.kernel.r *= scale, l.kernel.g *= scale, l.kernel.b *= scale, l.share *= scale;
    chosen.push_back(l);
  }
  return chosen;
}

/// Extinction of all media at the place of a light in one of them [1/unit].
Rgb sigmaTAround(const Scene& scene, int endless, const LightVertex& v) {
  const SceneView& view = scene.view;
  const Rgb own = view.media[v.medium].sigmaTAt(v.p);
  if (view.media.size == 1 && view.boundaries.size <= 1) return own;
  const MediaState media = mediaAt(scene, v.p, endless);
  Rgb sum;
  for (int i = 0; i < media.count(); ++i) sum += view.media[media.medium(i)].sigmaTAt(v.p);
  return isBlack(sum) ? own : sum;  // at the very border of its medium
}

constexpr float kDeepest = 6;  // measured: docs/decisions/ims-frame-balls.md

/// NearField::core of a light in media, by their optical depth within its radius.
KernelRgb coresFor(Rgb depth) {
  const auto core = [](float d) { return coreFor(std::min(kDeepest, d)); };
  const float red = core(depth.r);
  if (depth.r == depth.g && depth.r == depth.b) return {red, red, red};
  return {red, core(depth.g), core(depth.b)};
}

/// Radii of the lights of one kind, by how they lie.
void spread(std::span<FrameLights::Light> lights, VertexKind kind, float otherwise) {
  // Measured: docs/decisions/ims-frame-balls.md.
  constexpr float kTimesOnSurfaces = 12, kTimesInMedia = 64;
  const bool inMedia = kind == VertexKind::medium;
  const float times = inMedia ? kTimesInMedia : kTimesOnSurfaces;
  std::vector<PlacedLight> places;
  for (const FrameLights::Light& l : lights) places.push_back({positionOf(l), brightness(l)});
  const std::vector<float> radii = radiiOfNeighbours(places, times, static_cast<int>(2 * times), inMedia ? 3 : 2);
  for (size_t i = 0; i < lights.size(); ++i) lights[i].radius = radii[i] > 0 ? radii[i] : otherwise;
}

/// How much smaller balls may be made to keep their light in the media, by how many walks the lights are of: those of
/// one walk are heavy or light together, and where few walks reach the smoke it is noisy enough.
float leastBall(const VirtualLights& all, std::span<const FrameLights::Light> lights) {
  constexpr float kLeast = 0.44f;  // measured: docs/decisions/ims-frame-balls.md
  constexpr float kManyWalks = 400;
  std::vector<std::ptrdiff_t> walks;
  for (const FrameLights::Light& l : lights) {
    const auto number = static_cast<uint32_t>(l.vertex - all.lights.data());
    walks.push_back(std::upper_bound(all.firstOf.begin(), all.firstOf.end(), number) - all.firstOf.begin());
  }
  std::sort(walks.begin(), walks.end());
  const auto different = std::unique(walks.begin(), walks.end()) - walks.begin();
  return 1 - (1 - kLeast) * std::min(1.f, static_cast<float>(different) / kManyWalks);
}

/// Fits a light's ball to the media that it lies in, down to `least` of its radius: point number i of `between`.
void fitToMedia(const Scene& scene, int endless, const MediaBetween& between, size_t i, float least,
                FrameLights::Light& light) {
  const LightVertex& v = *light.vertex;
  const size_t part = between.partAround(i);
  const Rgb depth = sigmaTAround(scene, endless, v) * light.radius;
  // In thin fog it is often as wide as the room, and what is put back at walls would light its middle, which is seen.
  constexpr float kThin = 2;
  const bool thinFog = scene.view.media[v.medium].homogeneous && maxComponent(depth) < kThin;
  if (part == between.parts() || thinFog) {
    light.core = coresFor(depth);
    return;
  }
  static const float kMostCore = coreFor(kDeepest);
  const DepthTable tables[3] = {between.table(i, part, 0), between.table(i, part, between.grey() ? 0 : 1),
                                between.table(i, part, between.grey() ? 0 : 2)};
  const LightBall ball = ballWithin(std::span(tables).first(between.grey() ? 1 : 3), light.kernel, light.radius,
                                    least * light.radius, kMostCore);
  light.radius = ball.radius, light.core = ball.core;
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

FrameLights::FrameLights(const Scene& scene, VirtualLights lights, const Options& options, Kept& kept,
                         const std::stop_token& stop)
    : virtualLights_(std::move(lights)) {
  const SceneView& view = scene.view;
  const Nearness nearness(scene);
  const OfKind onSurfaces = lightsOf(view, virtualLights_, nearness, VertexKind::surface),
               inMedia = lightsOf(view, virtualLights_, nearness, VertexKind::medium);
  const auto most = static_cast<size_t>(options.most);
  const size_t surfaceShare = std::max(std::max<size_t>(1, most / 2), most - std::min(most, inMedia.lights.size()));
  lights_ = chosenOf(onSurfaces, kept.onSurfaces, surfaceShare, options.turn);
  const size_t mediaShare = std::max<size_t>(1, most - std::min(most - 1, lights_.size()));
  const std::vector<Light> more = chosenOf(inMedia, kept.inMedia, mediaShare, options.turn);
  const size_t onSurface = lights_.size();
  lights_.insert(lights_.end(), more.begin(), more.end());
  if (options.balls) {
    spread(std::span(lights_).first(onSurface), VertexKind::surface, options.radius);
    spread(std::span(lights_).subspan(onSurface), VertexKind::medium, options.radius);
  }
  if (options.shadows == ShadowMapping::maps) {
    refuseTooManyMaps(lights_.size(), options.maps.resolution, "lights");
    std::vector<LightVertex> vertices;
    for (const Light& l : lights_) vertices.push_back(*l.vertex);
    maps_ = std::make_shared<const LightMaps>(scene, vertices, options.maps, kept.maps.get(), stop);
  }
  kept.maps = stop.stop_requested() ? nullptr : maps_;
  std::vector<Vec3> places;
  for (const Light& l : lights_) places.push_back(aside(l, view));
  between_ = MediaBetween(scene, std::move(places), {}, stop);
  if (!options.balls || !options.fitted || stop.stop_requested()) return;
  const int endless = endlessMedium(scene);
  const float least = leastBall(virtualLights_, std::span(lights_).subspan(onSurface));
  parallelFor(static_cast<int64_t>(lights_.size() - onSurface), 16, [&](int64_t n) {
    const size_t i = onSurface + static_cast<size_t>(n);
    fitToMedia(scene, endless, between_, i, least, lights_[i]);
  });
}

float FrameLights::medianRadius() const {
  const bool anyInMedia = !lights_.empty() && lights_.back().vertex->kind == VertexKind::medium;
  std::vector<float> radii;
  for (const Light& l : lights_)
    if (!anyInMedia || l.vertex->kind == VertexKind::medium) radii.push_back(l.radius);
  if (radii.empty()) return 1;
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  return *middle;
}

bool FrameLights::gatherAtOnce(size_t i, const KernelReceivers& to, EndKind kind, const NearField& near) const {
  if (!between_.grey() || !maps_ || between_.parts() > 1) return false;
  const Light& light = lights_[i];
  const bool looksUp = between_.kind() == MediaBetween::Kind::tables;
  const DepthTable table = looksUp ? between_.table(i, 0, 0) : DepthTable{};
  gatherThrough(light.kernel, light.kind, to, kind, looksUp ? &table : nullptr, between_.fog().r, maps_->map(i), near);
  return true;
}

void FrameLights::lookFrom(size_t i, const KernelReceivers& to, EndKind kind, float* seen[3]) const {
  const KernelLight& light = lights_[i].kernel;
  between_.look(i, to, seen);
  if (!maps_) return;
  const KernelShadowMap map = maps_->map(i);
  lookThroughMap(light, to, kind, map, seen[0]);
  for (int c = 1; c < 3; ++c)
    if (seen[c] != seen[0]) lookThroughMap(light, to, kind, map, seen[c]);
}

}  // namespace virga
