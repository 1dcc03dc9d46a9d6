// SPDX-License-Identifier: Apache-2.0
#include "methods/path/path_method.h"

#include "methods/lamp_table_setting.h"
#include "methods/path/path_pixels.h"
#include "methods/pixels.h"
#include "methods/settings_reader.h"
#include "transport/virtual_lights.h"

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
    lampTable_ = LampTableSetting(reader, "path");
    seed_ = settings.seed;
    tables_.reset();
    tableSide();
  }

  Reset update(SceneSnapshot next, const ChangeSet& changes) override {
    if (!changes.cameraAlone()) tables_.reset();
    scene_ = std::move(next);
    tableSide();
    return changes.empty() ? Reset::nothingLost : Reset::film;
  }

  SettingValues settingsInForce() const override {
    const PathOptions options = optionsForScene();
    return {{"max_depth", std::to_string(options.maxDepth)},
            {"rr_depth", std::to_string(options.rrDepth)},
            {"equiangular_depth", std::to_string(options.equiangularDepth)},
            {"shared_paths", sharesPaths() ? "true" : "false"},
            {"lamp_table", std::to_string(tables_ && tables_->view().size == 0 ? 0 : tableSide())}};
  }

  PassResult pass(int64_t index, const Budget&, std::stop_token stop, PassFrame& frame) override {
    prepareTables(stop);
    if (stop.stop_requested()) return {.completed = false};
    const EmbreeRays rays{*scene_->surfaceRays, *scene_->boundaryRays};
    const PathPixels pixels(*scene_, rays, optionsForScene());
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
            .equiangularDepth = equiangularDepth_.value_or(PathOptions{}.equiangularDepth),
            .tabled = tables_ ? tables_->view() : View<TabledLamp>{}};
  }
  bool sharesPaths() const {
    return sharedPaths_ && SharedPaths<EmbreeRays>::possible(scene_->view, optionsForScene());
  }

  void prepareTables(const std::stop_token& stop) {
    const int around = endlessMedium(*scene_);
    if (tables_ && around == around_) return;
    auto tables = std::make_unique<TabledLamps>(*scene_, tableSide(), stop);
    if (!stop.stop_requested()) tables_ = std::move(tables), around_ = around;
  }
  /// Throws where tables would be too large.
  int tableSide() const {
    const int64_t pixels = int64_t{scene_->camera.filmWidth} * scene_->camera.filmHeight;
    const int usual = tabledLampSide(*scene_, pixels);
    return usual == 0 ? 0 : lampTable_.nodes(scene_->view, usual);
  }

  SceneSnapshot scene_;
  std::unique_ptr<TabledLamps> tables_;  ///< of this scene, once a pass has asked for them
  int around_ = 0;                       ///< the medium that had no end when they were made: the camera tells
  LampTableSetting lampTable_;
  bool sharedPaths_ = true;
  std::optional<int> maxDepth_, rrDepth_, equiangularDepth_;
  uint64_t seed_ = 0;
};

}  // namespace

std::unique_ptr<Method> createPath() { return std::make_unique<PathMethod>(); }

}  // namespace virga
