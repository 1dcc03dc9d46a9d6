// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/ims_method.h"

#include "methods/instant_scattering/fast.h"
#include "methods/instant_scattering/frame.h"
#include "transport/kept_walks.h"

namespace virga {
namespace {

class ImsMethod final : public Method {
 public:
  void prepare(SceneSnapshot scene, const Settings& settings, LayerMask) override {
    scene_ = std::move(scene);
    settings_ = ImsSettings(settings);
    settings_.forScene(*scene_);  // throws for what is out of proportion to it
    seed_ = settings.seed;
  }

  Reset update(SceneSnapshot next, const ChangeSet& changes) override {
    settings_.forScene(*next);
    const bool walksStay = walks_.edit(*scene_, *next, changes);
    scene_ = std::move(next);
    points_ = {};
    fast_.forget(changes);
    frame_.forget(changes, walksStay);
    return changes.empty() ? Reset::nothingLost : Reset::film;
  }

  SettingValues settingsInForce() const override { return valuesOf(settings_.forScene(*scene_)); }

  /// The virtual lights of the last pass: green on surfaces, red in media.
  Overlay overlay() const override { return overlay_; }

  PassResult pass(int64_t index, const Budget&, std::stop_token stop, PassFrame& frame) override {
    const ImsOptions options = settings_.forScene(*scene_);
    if (options.mode == ImsOptions::Mode::frame) {
      const SampleId id{seed_ ^ kWalkSeed, 0, 0, static_cast<uint32_t>(index)};
      const bool completed = frame_.pass(*scene_, options, id, walks_, stop, frame);
      if (frame_.lights())
        overlay_ = dotsOf(frame_.lights()->lights(), [](const FrameLights::Light& l) { return *l.vertex; });
      return {.completed = completed, .biased = true};
    }
    const auto replicate = static_cast<uint32_t>(index % Film::kReplicates);
    const auto sample = static_cast<uint32_t>(index / Film::kReplicates);
    const VirtualLights lights = lightsOf(index, options, {seed_ ^ kWalkSeed, replicate, 0, sample}, stop);
    overlay_ = dotsOf(lights.lights, [](const LightVertex& v) { return v; });
    const bool maps = options.visibility.mode == LightVisibilityOptions::Mode::shadowMap;
    if (maps && options.visibility.points > 0 && points_.cells() == 0)
      points_ = SurfacePoints(scene_->view, options.visibility.points, seed_);
    const LightVisibility visibility(*scene_, lights, points_, options.visibility,
                                     hash64(hash64(seed_ + replicate) + sample), stop);
    const bool fast = options.mode == ImsOptions::Mode::fast;
    const ImsPixels pixels(*scene_, lights, visibility.view(), options,
                           fast ? fast_.lampTables(*scene_, options, stop) : View<LampTable>{});
    const SampleId id{seed_, replicate, 0, sample};
    if (fast)
      fast_.pass(*scene_, pixels, options, id, stop, frame);
    else
      exactPass(pixels, id, stop, frame);
    return {.completed = !stop.stop_requested(), .biased = options.biased()};
  }

 private:
  /// Keeps the walks' random numbers apart from the pixels'.
  static constexpr uint64_t kWalkSeed = 0x6c62272e07bb0142ull;

  VirtualLights lightsOf(int64_t pass, const ImsOptions& options, SampleId id, std::stop_token stop) {
    const int maxDepth = options.path.maxDepth;
    const WalkOptions walks{options.walks, maxDepth < 0 ? -1 : std::max(0, maxDepth - 2), options.flights, options.aim};
    if (options.retrace >= 1) return traceVirtualLights(*scene_, walks, id, stop);
    return walks_.lights(*scene_, walks, id, pass, options.retrace, stop);
  }

  void exactPass(const ImsPixels& pixels, SampleId id, std::stop_token stop, PassFrame& frame) const {
    forEachPixel(frame, stop, [&](int x, int y) {
      LayerRadiance radiance = pixels.sample(x, y, of(id, x, y));
      radiance += pixels.sampleGlow(x, y, of(id, x, y));
      frame.set(x, y, radiance);
    });
  }

  SampleId of(SampleId id, int x, int y) const {
    id.stream = scene_->camera.pixelStream(x, y);
    return id;
  }
  /// The first of them: of a pass of `exact` there may be a hundred thousand.
  template <class Lights, class VertexOf>
  static Overlay dotsOf(const Lights& lights, const VertexOf& vertexOf) {
    constexpr size_t kMost = 8192;
    Overlay overlay;
    for (size_t i = 0; i < std::min(kMost, static_cast<size_t>(lights.size())); ++i) {
      const LightVertex v = vertexOf(lights[i]);
      overlay.dots.push_back({v.p, v.kind == VertexKind::surface ? Rgb(0, 1, 0) : Rgb(1, 0, 0)});
    }
    return overlay;
  }

  SceneSnapshot scene_;
  WalkStore walks_;       ///< from frame to frame, if any are kept
  SurfacePoints points_;  ///< of this scene; made when they are needed
  FastRenderer fast_;     ///< likewise
  FrameRenderer frame_;   ///< likewise
  Overlay overlay_;
  ImsSettings settings_;
  uint64_t seed_ = 0;
};

}  // namespace

std::unique_ptr<Method> createIms() { return std::make_unique<ImsMethod>(); }

}  // namespace virga
