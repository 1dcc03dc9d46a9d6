// SPDX-License-Identifier: Apache-2.0
// The kernels of a frame: virtual lights that light receivers, and densities along a ray; each beside a plain loop.
// Items are evaluations (a light and a receiver) or samples of the grid.
#include <benchmark/benchmark.h>

#include <vector>

#include "core/random.h"
#include "methods/instant_scattering/frame_kernels.h"
#include "volume/grid.h"
#include "volume/lookup_along.h"
#include "volume/procedural.h"

namespace virga {

void plainGather(const float* const light[6], int count, float x, float y, float z, float sigmaT, float sum[3]);

namespace {

constexpr int kReceivers = 512, kLights = 1300, kSide = 12, kRadii = 24;

std::vector<float> numbers(int count, uint64_t seed) {
  Pcg32 random(seed);
  std::vector<float> v(static_cast<size_t>(count));
  for (float& x : v) x = random.next();
  return v;
}

struct Receivers {
  std::vector<float> p[3] = {numbers(kReceivers, 1), numbers(kReceivers, 2), numbers(kReceivers, 3)};
  std::vector<float> axis[3] = {std::vector<float>(kReceivers, 0.6f), std::vector<float>(kReceivers, 0.8f),
                                std::vector<float>(kReceivers, 0.f)};
  std::vector<float> g = std::vector<float>(kReceivers, 0.6f), sum[3], seen = std::vector<float>(kReceivers, 1.f);
  Receivers() {
    for (auto& s : sum) s.assign(kReceivers, 0);
  }
  KernelReceivers view() {
    return {kReceivers,     p[0].data(), p[1].data(),   p[2].data(),   axis[0].data(), axis[1].data(),
            axis[2].data(), g.data(),    sum[0].data(), sum[1].data(), sum[2].data()};
  }
};

std::vector<KernelLight> lights() {
  Pcg32 random(7);
  std::vector<KernelLight> all;
  for (int i = 0; i < kLights; ++i)
    all.push_back(
        {random.next(), random.next(), random.next(), 0, 1, 0, random.next(), random.next(), random.next(), 0.6f});
  return all;
}

/// One fog, isotropic, one point at a time: what a loop by hand would be.
void plainLoop(benchmark::State& state) {
  Receivers r;
  std::vector<float> l[6];
  for (int c = 0; c < 6; ++c) l[c] = numbers(kLights, static_cast<uint64_t>(20 + c));
  const float* const light[6] = {l[0].data(), l[1].data(), l[2].data(), l[3].data(), l[4].data(), l[5].data()};
  for (auto _ : state) {
    float sum[3] = {};
    for (int i = 0; i < kReceivers; ++i) {
      const auto n = static_cast<size_t>(i);
      plainGather(light, kLights, r.p[0][n], r.p[1][n], r.p[2][n], 0.85f, sum);
    }
    benchmark::DoNotOptimize(sum);
  }
  state.SetItemsProcessed(state.iterations() * kReceivers * kLights);
}
BENCHMARK(plainLoop);

/// The frame's: transmittance, then the light; `from` and `to` say how both scatter.
template <EndKind from, EndKind to, bool table>
void frame(benchmark::State& state) {
  Receivers r;
  const std::vector<KernelLight> all = lights();
  const std::vector<float> depth = numbers(kSide * kSide * kRadii, 9);
  const KernelReceivers view = r.view();
  const float* const seen[3] = {r.seen.data(), r.seen.data(), r.seen.data()};
  for (auto _ : state)
    for (const KernelLight& light : all) {
      if (table) {
        std::fill(r.seen.begin(), r.seen.end(), 1.f);
        lookThroughTable({light.px, light.py, light.pz}, view,
                         {depth.data(), kSide, kRadii, {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1.8f}}, r.seen.data());
      } else {
        lookThroughFog({light.px, light.py, light.pz}, view, 0.85f, r.seen.data());
      }
      gatherLight(light, from, view, to, seen, {NearField::Kind::spread, 25});
    }
  benchmark::DoNotOptimize(r.sum[0].data());
  state.SetItemsProcessed(state.iterations() * kReceivers * kLights);
}
BENCHMARK(frame<EndKind::isotropic, EndKind::isotropic, false>);
BENCHMARK(frame<EndKind::lambertian, EndKind::isotropic, false>);
BENCHMARK(frame<EndKind::henyeyGreenstein, EndKind::henyeyGreenstein, false>);
BENCHMARK(frame<EndKind::isotropic, EndKind::isotropic, true>);
BENCHMARK(frame<EndKind::henyeyGreenstein, EndKind::henyeyGreenstein, true>);

/// All at once, through each light's own shadow map (and table): the loop that a frame spends its time in.
template <EndKind from, EndKind to, bool table>
void fused(benchmark::State& state) {
  constexpr int kMap = 32, kTexels = kMap * kMap, kNodes = kSide * kSide * kRadii;
  Receivers r;
  const std::vector<KernelLight> all = lights();
  const std::vector<float> depths = numbers(table ? kLights * kNodes : 0, 9), maps(kLights * kTexels, 10.f);
  const KernelReceivers view = r.view();
  for (auto _ : state)
    for (size_t i = 0; i < kLights; ++i) {
      const DepthTable looked{
          depths.data() + (table ? i * kNodes : 0), kSide, kRadii, {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1.8f}};
      gatherThrough(all[i], from, view, to, table ? &looked : nullptr, 0.85f, {&maps[i * kTexels], kMap, 0.125f, 0.1f},
                    {NearField::Kind::spread, 25});
    }
  benchmark::DoNotOptimize(r.sum[0].data());
  state.SetItemsProcessed(state.iterations() * kReceivers * kLights);
}
BENCHMARK(fused<EndKind::isotropic, EndKind::isotropic, false>);
BENCHMARK(fused<EndKind::lambertian, EndKind::isotropic, false>);
BENCHMARK(fused<EndKind::isotropic, EndKind::lambertian, false>);
BENCHMARK(fused<EndKind::henyeyGreenstein, EndKind::henyeyGreenstein, false>);
BENCHMARK(fused<EndKind::isotropic, EndKind::isotropic, true>);
BENCHMARK(fused<EndKind::henyeyGreenstein, EndKind::henyeyGreenstein, true>);

struct Plume {
  std::shared_ptr<const Grid> grid;
  Plume() {
    DenseVolume volume = makeProcedural(ProceduralKind::smoke, {.resolution = 128});
    grid = Grid::dense(volume.nx, volume.ny, volume.nz, std::move(volume.values), {});
  }
};

/// 64 samples along rays across a grid of 128^3: one by one, or by the loop that a march uses.
template <bool together>
void gridSamples(benchmark::State& state) {
  const Plume plume;
  const GridView grid = plume.grid->view();
  int pixel = 0;
  float out[64];
  for (auto _ : state) {
    // Ray after ray as in a picture of 256 x 256, obliquely across the grid.
    const Vec3 o(static_cast<float>(pixel % 256) * 0.4f, static_cast<float>(pixel / 256) * 0.4f, 0),
        d(0.3f, 0.2f, 1.9f);
    pixel = (pixel + 1) % (256 * 256);
    if (together)
      lookupAlong(grid, o, d, 64, out);
    else
      for (int n = 0; n < 64; ++n) out[n] = grid.lookup(o + d * static_cast<float>(n));
    benchmark::DoNotOptimize(out);
  }
  state.SetItemsProcessed(state.iterations() * 64);
}
BENCHMARK(gridSamples<false>);
BENCHMARK(gridSamples<true>);

}  // namespace
}  // namespace virga
