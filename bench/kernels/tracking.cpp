// SPDX-License-Identifier: Apache-2.0
// What a path spends its time on in a plume: grid lookups, free flights, transmittances, random numbers.
#include "transport/tracking.h"

#include <benchmark/benchmark.h>

#include "core/sampler.h"
#include "core/warp.h"
#include "volume/grid.h"
#include "volume/procedural.h"

namespace virga {
namespace {

/// A plume in [0, 1]^3 of optical depth about 20 across its core.
struct Plume {
  std::shared_ptr<const Grid> grid;
  MediumView medium;

  explicit Plume(int cellSize) {
    DenseVolume volume = makeProcedural(ProceduralKind::smoke, {.resolution = 128});
    grid = Grid::dense(volume.nx, volume.ny, volume.nz, std::move(volume.values), {.cellSize = cellSize});
    medium.homogeneous = false;
    medium.sigmaT = 40;
    medium.density = grid->view();
    medium.worldToDensity = Affine(grid->indexToWorld().inverse());
  }
};

Ray rayThroughCube(Pcg32& random) {
  const auto inside = [&] { return Vec3(random.next(), random.next(), random.next()); };
  const Vec3 target = inside(), d = uniformSphere({random.next(), random.next()});
  return {target - d * 2, d};
}

void lookupAlongRays(benchmark::State& state) {
  const Plume plume(8);
  const DenseGridView& dense = plume.medium.density.dense;
  Pcg32 random(1);
  float sum = 0;
  for (auto _ : state) {
    const Ray ray = rayThroughCube(random);
    for (int i = 0; i < 64; ++i)
      sum += dense.lookup(plume.medium.worldToDensity.point(ray.at(1.5f + static_cast<float>(i) / 64)));
  }
  benchmark::DoNotOptimize(sum);
  state.SetItemsProcessed(state.iterations() * 64);
}
BENCHMARK(lookupAlongRays);

void freeFlight(benchmark::State& state) {
  const Plume plume(static_cast<int>(state.range(0)));
  Pcg32 random(1);
  for (auto _ : state) benchmark::DoNotOptimize(sampleFreeFlight(plume.medium, rayThroughCube(random), 0, 4, random));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(freeFlight)->Arg(2)->Arg(4)->Arg(8)->Arg(16);

void transmittance(benchmark::State& state) {
  const Plume plume(static_cast<int>(state.range(0)));
  Pcg32 random(1);
  for (auto _ : state)
    benchmark::DoNotOptimize(estimateTransmittance(plume.medium, rayThroughCube(random), 0, 4, random));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(transmittance)->Arg(2)->Arg(4)->Arg(8)->Arg(16);

void samplerPairs(benchmark::State& state) {
  uint32_t index = 0;
  for (auto _ : state) {
    Sampler sampler({1, 0, 7, index++});
    for (int i = 0; i < 8; ++i) benchmark::DoNotOptimize(sampler.next2D());
  }
  state.SetItemsProcessed(state.iterations() * 8);
}
BENCHMARK(samplerPairs);

}  // namespace
}  // namespace virga
