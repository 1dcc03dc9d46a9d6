// SPDX-License-Identifier: Apache-2.0
// One ball that moves over a large standing mesh: what a frame costs, and what its rays do.
#include <benchmark/benchmark.h>

#include <cmath>

#include "core/random.h"
#include "core/warp.h"
#include "rays/ray_scene.h"

namespace virga {
namespace {

struct Mesh {
  std::vector<Vec3> positions;
  std::vector<std::array<uint32_t, 3>> triangles;
  std::shared_ptr<const RayShape> shape;

  /// n x n quadrilaterals; place(u, v) in [0, 1]^2.
  template <class Place>
  Mesh(uint32_t n, const Place& place) {
    const float step = 1 / static_cast<float>(n);
    for (uint32_t j = 0; j <= n; ++j)
      for (uint32_t i = 0; i <= n; ++i)
        positions.push_back(place(static_cast<float>(i) * step, static_cast<float>(j) * step));
    for (uint32_t j = 0; j < n; ++j)
      for (uint32_t i = 0; i < n; ++i) {
        const uint32_t a = j * (n + 1) + i, b = a + n + 1;
        triangles.push_back({a, a + 1, b});
        triangles.push_back({b, a + 1, b + 1});
      }
    positions.reserve(positions.size() + 2);  // Embree reads past the last vertex
    shape = RayShape::triangles(positions, triangles);
  }
};

const Mesh& ground() {
  static const Mesh mesh(
      400, [](float u, float v) { return Vec3(10 * u - 5, 0.3f * std::sin(40 * u) * std::sin(37 * v), 10 * v - 5); });
  return mesh;
}
Mesh ball(float x) {
  return Mesh(70, [x](float u, float v) {
    const float a = kTwoPi * u, b = kPi * v;
    return Vec3(x + std::cos(a) * std::sin(b), 1 + std::cos(b), std::sin(a) * std::sin(b));
  });
}

void frameFromScratch(benchmark::State& state) {
  const Mesh moved = ball(0.1f);
  for (auto _ : state) benchmark::DoNotOptimize(RayScene({ground().shape, moved.shape}).empty());
}
BENCHMARK(frameFromScratch)->MeasureProcessCPUTime();

void frameAfterAnother(benchmark::State& state) {
  const Mesh a = ball(0), b = ball(0.1f), c = ball(0.2f);
  const RayScene first({ground().shape, a.shape}), second({ground().shape, b.shape}, &first);
  for (auto _ : state) benchmark::DoNotOptimize(RayScene({ground().shape, c.shape}, &second).empty());
}
BENCHMARK(frameAfterAnother)->MeasureProcessCPUTime();

void trace(benchmark::State& state, const RayScene& scene) {
  Pcg32 random(1);
  float sum = 0;
  for (auto _ : state) {
    const Ray ray{Vec3(8 * random.next() - 4, 2.5f * random.next() + 0.5f, 8 * random.next() - 4),
                  uniformSphere({random.next(), random.next()})};
    const RayHit hit = scene.nearest(ray, 0, kInfinity);
    sum += hit.found() ? hit.t : 0;
  }
  benchmark::DoNotOptimize(sum);
  state.SetItemsProcessed(state.iterations());
}

void raysOfOneLevel(benchmark::State& state) {
  const Mesh moved = ball(0.1f);
  trace(state, RayScene({ground().shape, moved.shape}));
}
BENCHMARK(raysOfOneLevel);

void raysOfTwoLevels(benchmark::State& state) {
  const Mesh a = ball(0), b = ball(0.1f);
  const RayScene first({ground().shape, a.shape});
  trace(state, RayScene({ground().shape, b.shape}, &first));
}
BENCHMARK(raysOfTwoLevels);

}  // namespace
}  // namespace virga
