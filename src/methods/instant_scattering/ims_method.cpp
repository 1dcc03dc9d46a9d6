// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/ims_method.h"

#include "core/parallel.h"
#include "methods/instant_scattering/ims_pixels.h"

namespace virga {
namespace {

class ImsMethod final : public Method {
 public:
  void prepare(SceneSnapshot scene, const Settings& settings, LayerMask) override {
    scene_ = std::move(scene);
    settings_ = ImsSettings(settings);
    seed_ = settings.seed;
    refuse();
  }

  Reset update(SceneSnapshot next, const ChangeSet& changes) override {
    scene_ = std::move(next);
    refuse();
    return changes.empty() ? Reset::nothingLost : Reset::film;
  }

  SettingValues settingsInForce() const override { return valuesOf(settings_.forScene(*scene_)); }

  PassResult pass(int64_t index, const Budget&, std::stop_token stop, PassFrame& frame) override {
    const ImsOptions options = settings_.forScene(*scene_);
    const auto replicate = static_cast<uint32_t>(index % Film::kReplicates);
    const auto sample = static_cast<uint32_t>(index / Film::kReplicates);
    const VirtualLights lights = traceVirtualLights(
        *scene_, {options.walks, options.path.maxDepth < 0 ? -1 : std::max(0, options.path.maxDepth - 2)},
        {seed_ ^ kWalkSeed, replicate, 0, sample});
    const ImsPixels pixels(*scene_, lights, options);
    constexpr int kTile = 16;
    const int tilesX = (frame.width() + kTile - 1) / kTile, tilesY = (frame.height() + kTile - 1) / kTile;
    parallelFor(int64_t{tilesX} * tilesY, 1, [&](int64_t tile) {
      const int x0 = static_cast<int>(tile % tilesX) * kTile, y0 = static_cast<int>(tile / tilesX) * kTile;
      for (int y = y0; y < std::min(y0 + kTile, frame.height()); ++y)
        for (int x = x0; x < std::min(x0 + kTile, frame.width()) && !stop.stop_requested(); ++x)
          frame.set(x, y, pixels.sample(x, y, {seed_, replicate, scene_->camera.pixelStream(x, y), sample}));
    });
    return {.completed = !stop.stop_requested(), .biased = options.biased()};
  }

 private:
  /// Keeps the walks' random numbers apart from the pixels'.
  static constexpr uint64_t kWalkSeed = 0x6c62272e07bb0142ull;

  void refuse() const {
    if (scene_->view.emissive)
      throw Error("method \"ims\" does not carry the light of media that glow", {{}, "render with --method path", {}});
  }

  SceneSnapshot scene_;
  ImsSettings settings_;
  uint64_t seed_ = 0;
};

}  // namespace

std::unique_ptr<Method> createIms() { return std::make_unique<ImsMethod>(); }

}  // namespace virga
