// SPDX-License-Identifier: Apache-2.0
// Whole frames of `ims.mode=frame` at 640 x 480: the first one of a scene, and those while the camera moves, against
// the number of virtual lights. VIRGA_FRAME_SCENES names more scenes, files between colons.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <functional>

#include "bench_scenes.h"
#include "methods/render_session.h"

namespace virga {
namespace {

RenderSession::Options options(int64_t lights) {
  return {.settings = {.values = {{"mode", "frame"}, {"lights", std::to_string(lights)}}}};
}

/// Walks, tables, shadow maps and a picture.
void first(benchmark::State& state, const std::function<SceneSnapshot()>& build) {
  const SceneSnapshot scene = build();
  for (auto _ : state) {
    RenderSession session(scene, findMethod("ims"), options(state.range(0)));
    session.step();
  }
}
/// The camera has moved: the lights stay.
void steady(benchmark::State& state, const std::function<SceneSnapshot()>& build) {
  const SceneSnapshot scene = build();
  RenderSession session(scene, findMethod("ims"), options(state.range(0)));
  session.step();
  for (auto _ : state) {
    session.edit(scene, {{{{"camera"}, Aspect::camera}}});
    session.step();
  }
}

void add(const std::string& name, const std::function<SceneSnapshot()>& build) {
  for (const auto& [kind, run] : {std::pair{"first", &first}, std::pair{"steady", &steady}})
    benchmark::RegisterBenchmark(fmt::format("{}/{}", name, kind).c_str(), run, build)
        ->Arg(325)
        ->Arg(1300)
        ->Arg(5200)
        ->Unit(benchmark::kMillisecond)
        ->MeasureProcessCPUTime()
        ->UseRealTime();
}

const bool kAdded = [] {
  for (const BenchScene& scene : benchScenes("VIRGA_FRAME_SCENES")) add(scene.name, scene.build);
  return true;
}();

}  // namespace
}  // namespace virga
