// SPDX-License-Identifier: Apache-2.0
// The floor of path tracing in smoke: the very lookups that paths make, in their order, with nothing else around them.
#include <benchmark/benchmark.h>

#include "core/warp.h"
#include "transport/tracking.h"
#include "volume/grid.h"
#include "volume/procedural.h"

namespace virga {
namespace {

/// A plume in [0, 1]^3, as thick as that of the benchmark scene.
struct Smoke {
  std::shared_ptr<const Grid> grid;
  MediumView medium;

  Smoke() {
    DenseVolume volume = makeProcedural(ProceduralKind::smoke, {.resolution = 128});
    grid = Grid::dense(volume.nx, volume.ny, volume.nz, std::move(volume.values));
    medium.homogeneous = false;
    medium.sigmaT = 40;
    medium.density = grid->view();
    medium.worldToDensity = Affine(grid->indexToWorld().inverse());
  }
};

/// What paths of an isotropic, nearly white plume under a point light do in its grid.
class PathWork {
 public:
  struct Flight {
    Ray ray;
    float tMax;
  };
  std::vector<Vec3> lookups;  ///< of free flights and shadow rays, in the order of the paths
  std::vector<Flight> flights, shadows;

  /// One path through each pixel, tile by tile as pictures are rendered.
  explicit PathWork(const Smoke& smoke) : smoke_(smoke) {
    for (int tile = 0; tile < square(kPixels / kTile); ++tile)
      for (int i = 0; i < square(kTile); ++i)
        addPath(tile % (kPixels / kTile) * kTile + i % kTile, tile / (kPixels / kTile) * kTile + i / kTile);
  }

 private:
  static constexpr int kPixels = 256, kTile = 16, kMostEvents = 64;
  static constexpr float kAlbedo = 0.95f, kView = 1;  ///< [1]; edge of the picture, in edges of the cube

  static constexpr int square(int x) { return x * x; }

  void addPath(int x, int y) {
    const auto offset = [&](int i) { return (static_cast<float>(i) + random_.next()) / kPixels - 0.5f; };
    const Vec3 eye{0.5f, 0.75f, 3};
    Ray ray{eye, normalize(Vec3(offset(x) * kView, -0.275f - offset(y) * kView, -2.5f))};
    for (int event = 0; event < kMostEvents && random_.next() < kAlbedo; ++event) {
      const float t = addFlight(ray);
      if (t == kInfinity) return;
      const Vec3 p = ray.at(t);
      addShadow(p);
      ray = {p, uniformSphere({random_.next(), random_.next()})};
    }
  }

  float addFlight(const Ray& ray) {
    flights.push_back({ray, 9});
    float found = kInfinity;
    const auto visit = [&](const TentativeCollision& c) {
      lookups.push_back(c.p);
      const bool real = random_.next() < c.ratio(smoke_.medium);
      if (real) found = c.t;
      return !real;
    };
    forEachTentativeCollision(smoke_.medium, smoke_.medium.sigmaT, ray, 0, 9, random_, visit, IgnoreLength{});
    return found;
  }

  void addShadow(Vec3 p) {
    const Vec3 toLight = Vec3(-0.75f, 2, 1.25f) - p;
    const Ray ray{p, normalize(toLight)};
    shadows.push_back({ray, length(toLight)});
    float transmittance = 1;
    const auto visit = [&](const TentativeCollision& c) {
      lookups.push_back(c.p);
      transmittance *= 1 - c.ratio(smoke_.medium);
      if (transmittance >= kTransmittanceRoulette) return true;
      const bool survives = random_.next() * kTransmittanceRoulette < transmittance;
      transmittance = kTransmittanceRoulette;
      return survives;
    };
    forEachTentativeCollision(smoke_.medium, smoke_.medium.sigmaT, ray, 0, shadows.back().tMax, random_, visit,
                              IgnoreLength{});
  }

  const Smoke& smoke_;
  Pcg32 random_{1};
};

struct Bench {
  Smoke smoke;
  PathWork work{smoke};

  static const Bench& get() {
    static const Bench bench;
    return bench;
  }
};

void lookupsOfPaths(benchmark::State& state) {
  const Bench& b = Bench::get();
  const GridView& density = b.smoke.medium.density;
  float sum = 0;
  for (auto _ : state)
    for (const Vec3& p : b.work.lookups) sum += density.lookupInside(p);
  benchmark::DoNotOptimize(sum);
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(b.work.lookups.size()));
}
BENCHMARK(lookupsOfPaths);

/// The same, where each has to wait for the one before it: no two in flight at once.
void lookupsOneByOne(benchmark::State& state) {
  const Bench& b = Bench::get();
  const GridView& density = b.smoke.medium.density;
  float last = 0;
  for (auto _ : state)
    for (const Vec3& p : b.work.lookups) last = density.lookupInside(p + Vec3(last * 1e-20f));
  benchmark::DoNotOptimize(last);
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(b.work.lookups.size()));
}
BENCHMARK(lookupsOneByOne);

/// The majorant cells that shadow rays pass through from end to end.
void cellsOfShadows(benchmark::State& state) {
  const Bench& b = Bench::get();
  const MediumView& medium = b.smoke.medium;
  float depth = 0;
  int64_t cells = 0;
  const auto visit = [&](float t0, float t1, float majorant, bool) {
    depth += (t1 - t0) * majorant;
    ++cells;
    return true;
  };
  for (auto _ : state)
    for (const PathWork::Flight& f : b.work.shadows) {
      const GridRay ray(medium, f.ray);
      forEachMajorant(medium.density, ray.o, ray.d, 0, f.tMax, visit);
    }
  benchmark::DoNotOptimize(depth);
  state.SetItemsProcessed(cells);
}
BENCHMARK(cellsOfShadows);

void flightsOfPaths(benchmark::State& state) {
  const Bench& b = Bench::get();
  Pcg32 random(2);
  for (auto _ : state)
    for (const PathWork::Flight& f : b.work.flights)
      benchmark::DoNotOptimize(sampleFreeFlight(b.smoke.medium, f.ray, 0, f.tMax, random));
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(b.work.flights.size()));
}
BENCHMARK(flightsOfPaths);

void shadowsOfPaths(benchmark::State& state) {
  const Bench& b = Bench::get();
  Pcg32 random(2);
  for (auto _ : state)
    for (const PathWork::Flight& f : b.work.shadows)
      benchmark::DoNotOptimize(estimateTransmittance(b.smoke.medium, f.ray, 0, f.tMax, random));
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(b.work.shadows.size()));
}
BENCHMARK(shadowsOfPaths);

}  // namespace
}  // namespace virga
