// SPDX-License-Identifier: Apache-2.0
#include "methods/path/path_method.h"

#include "methods/path/path_pixels.h"
#include "methods/pixels.h"
#include "methods/settings_reader.h"

namespace virga {
namespace {

class PathMethod final : public Method {
 public:
  void prepare(SceneSnapshot scene, const Settings& settings, LayerMask) override {
    scene_ = std::move(scene);
    SettingsReader reader(settings, kPathSettings, "path");
    maxDepth_ = reader.integer("max_depth", -1);
    rrDepth_ = reader.integer("rr_depth", 1);
    equiangularDepth_ = reader.integer("equiangular_depth", 0);
    sharedPaths_ = reader.boolean("shared_paths").value_or(true);
    seed_ = settings.seed;
  }

  Reset update(SceneSnapshot next, const ChangeSet& changes) override {
    scene_ = std::move(next);
    return changes.empty() ? Reset::nothingLost : Reset::film;
  }

  SettingValues settingsInForce() const override {
    const PathOptions options = optionsForScene();
    return {{"max_depth", std::to_string(options.maxDepth)},
            {"rr_depth", std::to_string(options.rrDepth)},
            {"equiangular_depth", std::to_string(options.equiangularDepth)},
            {"shared_paths", sharesPaths() ? "true" : "false"}};
  }

  PassResult pass(int64_t index, const Budget&, std::stop_token stop, PassFrame& frame) override {
    const PathPixels pixels(*scene_, optionsForScene());
    const auto replicate = static_cast<uint32_t>(index % Film::kReplicates);
    const auto sample = static_cast<uint32_t>(index / Film::kReplicates);
    const SampleId id{seed_, replicate, 0, sample};
    if (sharesPaths()) {
      const PixelGroups groups(frame.width(), frame.height(), hash64(seed_) + static_cast<uint64_t>(index));
      forEachGroup(groups, stop, [&](std::span<const PixelAt> group) {
        pixels.sampleGroup(group, id, [&](PixelAt at, const LayerRadiance& r) { frame.set(at.x, at.y, r); });
      });
      return {.completed = !stop.stop_requested()};
    }
    forEachPixel(frame, stop, [&](int x, int y) {
      frame.set(x, y, pixels.sample(x, y, {seed_, replicate, scene_->camera.pixelStream(x, y), sample}));
    });
    return {.completed = !stop.stop_requested()};
  }

 private:
  PathOptions optionsForScene() const {
    return {.maxDepth = maxDepth_.value_or(scene_->integrator.maxDepth),
            .rrDepth = rrDepth_.value_or(scene_->integrator.rrDepth),
            .equiangularDepth = equiangularDepth_.value_or(PathOptions{}.equiangularDepth)};
  }
  bool sharesPaths() const {
    return sharedPaths_ && SharedPaths<EmbreeRays>::possible(scene_->view, optionsForScene());
  }

  SceneSnapshot scene_;
  bool sharedPaths_ = true;
  std::optional<int> maxDepth_, rrDepth_, equiangularDepth_;
  uint64_t seed_ = 0;
};

}  // namespace

std::unique_ptr<Method> createPath() { return std::make_unique<PathMethod>(); }

}  // namespace virga
