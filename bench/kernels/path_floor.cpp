// SPDX-License-Identifier: Apache-2.0
// The floor of path tracing: the very lookups and ray queries that paths make, in their order, with nothing else around
// them, beside the paths themselves. One thread. VIRGA_PATH_SCENES names more scenes, files between colons.
//
// `a_path`: the time of all that a path has; `n/path`: how many those are.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "bench_scenes.h"
#include "path_record.h"
#include "transport/optical_depth.h"
#include "transport/tabled_lamps.h"

namespace virga {
namespace {

/// A scene and what its paths ask for, with lamps' tables or without.
struct PathWork {
  SceneSnapshot scene;
  TabledLamps lamps;
  PathOptions options;
  PathRecord record;

  PathWork(const BenchScene& from, bool tables) : scene(from.build()) {
    const int64_t pixels = int64_t{scene->camera.width} * scene->camera.height;
    if (tables) lamps = TabledLamps(*scene, tabledLampSide(*scene, pixels), {});
    options.maxDepth = scene->integrator.maxDepth, options.rrDepth = scene->integrator.rrDepth;
    options.tabled = lamps.view();
    record = recordPaths(*scene, options);
  }
  const MediumView& medium(int index) const { return scene->view.media[index]; }
};

using Run = void (*)(benchmark::State&, const PathWork&);

/// Time and number of what has been done `count` times for all paths.
void report(benchmark::State& state, const PathWork& work, size_t count) {
  const auto n = static_cast<double>(count), paths = static_cast<double>(work.record.paths);
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(count));
  using benchmark::Counter;
  const auto time = static_cast<Counter::Flags>(Counter::kIsIterationInvariantRate | Counter::kInvert);
  state.counters["a_path"] = Counter(paths, time);
  state.counters["n/path"] = n / paths;
}

void wholePaths(benchmark::State& state, const PathWork& work) {
  uint32_t replicate = 0;
  for (auto _ : state) tracePaths(*work.scene, work.options, ++replicate);
  report(state, work, static_cast<size_t>(work.record.paths));
}

/// As many in flight as the processor likes.
void lookups(benchmark::State& state, const PathWork& work) {
  float sum = 0;
  for (auto _ : state)
    for (const MediumPoint& at : work.record.lookups) sum += work.medium(at.medium).density.lookupInside(at.p);
  benchmark::DoNotOptimize(sum);
  report(state, work, work.record.lookups.size());
}
/// Each has to wait for the one before it, as along a ray.
void lookupsOneByOne(benchmark::State& state, const PathWork& work) {
  float last = 0;
  for (auto _ : state)
    for (const MediumPoint& at : work.record.lookups)
      last = work.medium(at.medium).density.lookupInside(at.p + Vec3(last * 1e-20f));
  benchmark::DoNotOptimize(last);
  report(state, work, work.record.lookups.size());
}

/// Cells of majorants from end to end of each shadow ray, and of each free flight up to a random place.
void cells(benchmark::State& state, const PathWork& work) {
  float depth = 0;
  size_t count = 0;
  const auto pass = [&](const GridFlight& f, float depthLeft) {
    const MediumView& medium = work.medium(f.medium);
    const GridRay ray(medium, f.ray);
    forEachMajorant(medium.density, ray.o, ray.d, f.t0, f.t1, [&](float t0, float t1, float majorant, bool) {
      const float here = (t1 - t0) * majorant * medium.sigmaT;
      depth += here, depthLeft -= here;
      ++count;
      return depthLeft > 0;
    });
  };
  for (auto _ : state) {
    count = 0;
    for (const GridFlight& f : work.record.shadows) pass(f, kInfinity);
    for (const GridFlight& f : work.record.freeFlights) pass(f, 1);
  }
  benchmark::DoNotOptimize(depth);
  report(state, work, count);
}

void freeFlights(benchmark::State& state, const PathWork& work) {
  Pcg32 random(2);
  for (auto _ : state)
    for (const GridFlight& f : work.record.freeFlights)
      benchmark::DoNotOptimize(sampleFreeFlight(work.medium(f.medium), f.ray, f.t0, f.t1, random));
  report(state, work, work.record.freeFlights.size());
}
void shadows(benchmark::State& state, const PathWork& work) {
  Pcg32 random(2);
  for (auto _ : state)
    for (const GridFlight& f : work.record.shadows)
      benchmark::DoNotOptimize(estimateTransmittance(work.medium(f.medium), f.ray, f.t0, f.t1, random));
  report(state, work, work.record.shadows.size());
}

void tableLookups(benchmark::State& state, const PathWork& work) {
  float sum = 0;
  for (auto _ : state)
    for (const Vec3& x : work.record.tableLookups) sum += work.record.table->depthTo(x).r;
  benchmark::DoNotOptimize(sum);
  report(state, work, work.record.tableLookups.size());
}
void tableLookupsOneByOne(benchmark::State& state, const PathWork& work) {
  float last = 0;
  for (auto _ : state)
    for (const Vec3& x : work.record.tableLookups) last = work.record.table->depthTo(x + Vec3(last * 1e-20f)).r;
  benchmark::DoNotOptimize(last);
  report(state, work, work.record.tableLookups.size());
}
/// Exact optical depths, their boundaries included.
void tableChecks(benchmark::State& state, const PathWork& work) {
  const EmbreeRays rays{*work.scene->surfaceRays, *work.scene->boundaryRays};
  float sum = 0;
  for (auto _ : state)
    for (const TableCheck& check : work.record.checks)
      sum += opticalDepth(work.scene->view, rays, check.from, check.tMax).r;
  benchmark::DoNotOptimize(sum);
  report(state, work, work.record.checks.size());
}

void nearestHits(benchmark::State& state, const PathWork& work) {
  const EmbreeRays rays{*work.scene->surfaceRays, *work.scene->boundaryRays};
  for (auto _ : state)
    for (const QueriedRay& q : work.record.nearest) benchmark::DoNotOptimize(rays.nearest(q.ray, q.tMax));
  report(state, work, work.record.nearest.size());
}
void occlusions(benchmark::State& state, const PathWork& work) {
  const EmbreeRays rays{*work.scene->surfaceRays, *work.scene->boundaryRays};
  for (auto _ : state)
    for (const QueriedRay& q : work.record.occluded) benchmark::DoNotOptimize(rays.occluded(q.ray, q.tMax));
  report(state, work, work.record.occluded.size());
}
void packetOcclusions(benchmark::State& state, const PathWork& work) {
  const EmbreeRays rays{*work.scene->surfaceRays, *work.scene->boundaryRays};
  for (auto _ : state)
    for (const RayPacket& packet : work.record.packets) benchmark::DoNotOptimize(rays.occluded(packet));
  report(state, work, work.record.packets.size());
}
void crossings(benchmark::State& state, const PathWork& work) {
  const EmbreeRays rays{*work.scene->surfaceRays, *work.scene->boundaryRays};
  for (auto _ : state)
    for (const QueriedRay& q : work.record.crossings) {
      CrossingList list;
      rays.crossings(q.ray, 0, q.tMax, list);
      benchmark::DoNotOptimize(list.count);
    }
  report(state, work, work.record.crossings.size());
}

/// Adds the benchmarks of a scene; its paths are recorded when the first of them runs.
void add(const BenchScene& scene, bool tables) {
  const auto work = std::make_shared<std::unique_ptr<PathWork>>();
  const auto run = [=](benchmark::State& state, Run what) {
    if (!*work) *work = std::make_unique<PathWork>(scene, tables);
    what(state, **work);
  };
  const std::pair<const char*, Run> all[] = {{"whole", &wholePaths},
                                             {"lookups", &lookups},
                                             {"lookupsOneByOne", &lookupsOneByOne},
                                             {"cells", &cells},
                                             {"freeFlights", &freeFlights},
                                             {"shadows", &shadows},
                                             {"tableLookups", &tableLookups},
                                             {"tableLookupsOneByOne", &tableLookupsOneByOne},
                                             {"tableChecks", &tableChecks},
                                             {"nearest", &nearestHits},
                                             {"occluded", &occlusions},
                                             {"occludedPackets", &packetOcclusions},
                                             {"crossings", &crossings}};
  for (const auto& [name, what] : all)
    benchmark::RegisterBenchmark(fmt::format("paths/{}{}/{}", scene.name, tables ? "" : "/shadowRays", name).c_str(),
                                 run, what)
        ->Unit(benchmark::kMillisecond);
}

const bool kAdded = [] {
  for (const BenchScene& scene : benchScenes("VIRGA_PATH_SCENES"))
    for (const bool tables : {true, false}) add(scene, tables);
  return true;
}();

}  // namespace
}  // namespace virga
