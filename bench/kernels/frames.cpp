// SPDX-License-Identifier: Apache-2.0
// Whole frames of `ims.mode=frame` at 640 x 480: the first one of a scene, and those while the camera moves, against
// the number of virtual lights. VIRGA_FRAME_SCENES names more scenes, files between colons.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <ctime>
#include <functional>

#include "bench_scenes.h"
#include "methods/instant_scattering/upsampling.h"
#include "methods/render_session.h"

namespace virga {
namespace {

RenderSession::Options options(int64_t lights) {
  return {.settings = {.values = {{"mode", "frame"}, {"lights", std::to_string(lights)}}}};
}

/// What a steady picture of a scene looks up and evaluates.
struct Work {
  int64_t samples = 0;    ///< of grids along the eye rays, without those that are 0
  int64_t receivers = 0;  ///< that each light lights

  explicit Work(const Scene& scene) : scene_(scene), eye_(std::make_unique<MarchedEye>()) {
    const int width = scene.camera.width, height = scene.camera.height;
    std::vector<PixelFeatures> features;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        march(x, y);
        features.push_back(pixelFeatures(*eye_));
        for (int i = 0; i < eye_->steps; ++i) samples += isGrid(eye_->media[eye_->step[i].stretch]) ? 1 : 0;
      }
    const Upsampling upsampling(features, width, height, 8, {4, 4});
    const std::vector<Upsampling::Light> none(upsampling.coarse().size());
    light(upsampling.coarse());
    light(upsampling.spread(none, {}, [](int, int, const Upsampling::Light&) {}));
  }

 private:
  void march(int x, int y) {
    const EyeStart start = middleOf(scene_, x, y);
    marchEye(scene_.view, EmbreeRays{*scene_.surfaceRays, *scene_.boundaryRays}, start.camera, start.shift, *eye_);
  }
  void light(const std::vector<Upsampling::Pixel>& pixels) {
    constexpr int kPoints = 4;
    for (const auto [x, y] : pixels) {
      march(x, y);
      if (eye_->plain) receivers += (eye_->opacity() > 0 ? kPoints : 0) + (eye_->hit.found() ? 1 : 0);
    }
  }
  bool isGrid(const MediaState& media) const {
    for (int i = 0; i < media.count(); ++i)
      if (!scene_.view.media[media.medium(i)].homogeneous) return true;
    return false;
  }

  const Scene& scene_;
  std::unique_ptr<MarchedEye> eye_;
};

/// Walks, tables, shadow maps and a picture.
void first(benchmark::State& state, const std::function<SceneSnapshot()>& build) {
  const SceneSnapshot scene = build();
  for (auto _ : state) {
    RenderSession session(scene, findMethod("ims"), options(state.range(0)));
    session.step();
  }
}
/// The camera has moved: the lights stay. Counters: of a CPU second of the whole frame.
void steady(benchmark::State& state, const std::function<SceneSnapshot()>& build) {
  const SceneSnapshot scene = build();
  RenderSession session(scene, findMethod("ims"), options(state.range(0)));
  session.step();
  const Work work(*scene);
  const std::clock_t start = std::clock();
  for (auto _ : state) {
    session.edit(scene, {{{{"camera"}, Aspect::camera}}});
    session.step();
  }
  const double frames =
      static_cast<double>(state.iterations()) * CLOCKS_PER_SEC / static_cast<double>(std::clock() - start);
  state.counters["evaluations"] = static_cast<double>(work.receivers * state.range(0)) * frames;
  state.counters["samples"] = static_cast<double>(work.samples) * frames;
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
