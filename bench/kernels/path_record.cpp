// SPDX-License-Identifier: Apache-2.0
#include "path_record.h"

#include <benchmark/benchmark.h>

#include "transport/virtual_lights.h"

namespace virga {
namespace {

/// Answers ray queries and tells of them.
class RecordingRays {
 public:
  RecordingRays(const Scene& scene, PathRecord& record)
      : scene_(scene), rays_{*scene.surfaceRays, *scene.boundaryRays}, record_(record) {}

  RayHit nearest(const Ray& ray, float tMax) const {
    record_.nearest.push_back({ray, tMax});
    const RayHit hit = rays_.nearest(ray, tMax);
    addFlights(ray, hit.found() ? hit.t : tMax, record_.freeFlights, true);
    return hit;
  }
  bool occluded(const Ray& ray, float tMax) const {
    record_.occluded.push_back({ray, tMax});
    const bool found = rays_.occluded(ray, tMax);
    if (!found) addFlights(ray, tMax, record_.shadows, false);
    return found;
  }
  uint32_t occluded(const RayPacket& rays) const {
    record_.packets.push_back(rays);
    return rays_.occluded(rays);
  }
  void crossings(const Ray& ray, float tMin, float tMax, CrossingList& list) const {
    record_.crossings.push_back({ray, tMax});
    rays_.crossings(ray, tMin, tMax, list);
    if (isCheck(ray, tMax)) record_.checks.push_back({{ray, mediaAt(scene_, ray.o, endless_), 0}, tMax});
  }

 private:
  /// Boundaries on the way to a lamp without any other query before: a table is checked.
  bool isCheck(const Ray& ray, float tMax) const {
    if (!record_.table) return false;
    const Vec3 end = ray.at(tMax);
    const bool toLamp = tMax < kInfinity && distance(end, record_.table->p) < 1e-3f * distance(ray.o, end);
    return toLamp && (record_.occluded.empty() || !(record_.occluded.back().ray.o == ray.o));
  }

  void addFlights(const Ray& ray, float tMax, std::vector<GridFlight>& flights, bool free) const {
    MediaRay r{ray, mediaAt(scene_, ray.o, endless_), 0};
    walkMedia(scene_.view, rays_, r, tMax, [&](float t0, float t1) {
      bool goesOn = true;
      for (int i = 0; i < r.media.count(); ++i) {
        const int medium = r.media.medium(i);
        if (scene_.view.media[medium].homogeneous) continue;
        flights.push_back({ray, t0, t1, medium});
        goesOn &= free ? flyFreely(flights.back()) : passThrough(flights.back());
      }
      return goesOn;
    });
  }
  bool flyFreely(const GridFlight& f) const {
    const MediumView& medium = scene_.view.media[f.medium];
    const GridRay g(medium, f.ray);
    const auto met = [&](float t, float ratio) {
      record_.lookups.push_back({g.o + g.d * t, f.medium});
      if (record_.table && random_.next() * 0.1f < ratio) record_.tableLookups.push_back(f.ray.at(t));
    };
    return !(trackFreeFlight(medium, f.ray, f.t0, f.t1, random_, met) < f.t1);
  }
  bool passThrough(const GridFlight& f) const {
    const MediumView& medium = scene_.view.media[f.medium];
    float transmittance = 1;
    const auto visit = [&](const TentativeCollision& c) {
      record_.lookups.push_back({c.p, f.medium});
      transmittance *= 1 - c.ratio(medium);
      if (transmittance >= kTransmittanceRoulette) return true;
      const bool survives = random_.next() * kTransmittanceRoulette < transmittance;
      transmittance = kTransmittanceRoulette;
      return survives;
    };
    forEachTentativeCollision(medium, medium.sigmaT, f.ray, f.t0, f.t1, random_, visit, IgnoreLength{});
    return true;
  }

  const Scene& scene_;
  EmbreeRays rays_;
  PathRecord& record_;
  int endless_ = endlessMedium(scene_);
  mutable Pcg32 random_{1};
};

const LampTable* tableOf(View<TabledLamp> lamps) {
  for (const TabledLamp& lamp : lamps)
    if (lamp.present()) return &lamp.table;
  return nullptr;
}

template <class Rays>
void traceInGroups(const Scene& scene, const PathPixels<Rays>& pixels, const SampleId& id) {
  const PixelGroups groups(scene.camera.width, scene.camera.height, id.replicate);
  for (int64_t tile = 0; tile < int64_t{groups.tilesX()} * groups.tilesY(); ++tile)
    for (int g = 0; g < PixelGroups::kGroups; ++g) {
      std::array<PixelAt, PixelGroups::kMostPixels> group;
      pixels.sampleGroup(groups.group(tile, g, group), id,
                         [](PixelAt, LayerRadiance radiance) { benchmark::DoNotOptimize(radiance); });
    }
}

template <class Rays>
void traceOneByOne(const Scene& scene, const PathPixels<Rays>& pixels, SampleId id) {
  constexpr int kTile = 16;
  const int width = scene.camera.width, height = scene.camera.height;
  for (int tileY = 0; tileY < height; tileY += kTile)
    for (int tileX = 0; tileX < width; tileX += kTile)
      for (int i = 0; i < kTile * kTile; ++i) {
        const int x = tileX + i % kTile, y = tileY + i / kTile;
        if (x >= width || y >= height) continue;
        id.stream = scene.camera.pixelStream(x, y);
        LayerRadiance radiance = pixels.sample(x, y, id);
        benchmark::DoNotOptimize(radiance);
      }
}

template <class Rays>
int64_t trace(const Scene& scene, const Rays& rays, const PathOptions& options, uint32_t replicate) {
  const PathPixels<Rays> pixels(scene, rays, options);
  const SampleId id{1, replicate, 0, 0};
  if (SharedPaths<Rays>::possible(scene.view, options))
    traceInGroups(scene, pixels, id);
  else
    traceOneByOne(scene, pixels, id);
  return int64_t{scene.camera.width} * scene.camera.height;
}

}  // namespace

PathRecord recordPaths(const Scene& scene, const PathOptions& options) {
  PathRecord record;
  record.table = tableOf(options.tabled);
  record.paths = trace(scene, RecordingRays(scene, record), options, 0);
  return record;
}

int64_t tracePaths(const Scene& scene, const PathOptions& options, uint32_t replicate) {
  return trace(scene, EmbreeRays{*scene.surfaceRays, *scene.boundaryRays}, options, replicate);
}

}  // namespace virga
