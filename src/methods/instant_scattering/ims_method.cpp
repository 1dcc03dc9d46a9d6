// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/ims_method.h"

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
    walks_.edit(*scene_, *next, changes);
    scene_ = std::move(next);
    upsampling_ = nullptr;
    points_ = {};
    renderer_.forget(changes);
    return changes.empty() ? Reset::nothingLost : Reset::film;
  }

  SettingValues settingsInForce() const override { return valuesOf(settings_.forScene(*scene_)); }

  /// The virtual lights of the last pass: green on surfaces, red in media.
  Overlay overlay() const override { return overlay_; }

  PassResult pass(int64_t index, const Budget&, std::stop_token stop, PassFrame& frame) override {
    const ImsOptions options = settings_.forScene(*scene_);
    if (options.mode == ImsOptions::Mode::frame) {
      const bool completed =
          renderer_.pass(*scene_, options, seed_ ^ kWalkSeed, static_cast<uint32_t>(index), stop, frame);
      if (renderer_.lights()) overlay_ = dotsOf(renderer_.lights()->virtualLights());
      return {.completed = completed, .biased = true};
    }
    const auto replicate = static_cast<uint32_t>(index % Film::kReplicates);
    const auto sample = static_cast<uint32_t>(index / Film::kReplicates);
    const VirtualLights lights = lightsOf(index, options, {seed_ ^ kWalkSeed, replicate, 0, sample}, stop);
    overlay_ = dotsOf(lights);
    const bool maps = options.visibility.mode == LightVisibilityOptions::Mode::shadowMap;
    if (maps && options.visibility.points > 0 && points_.cells() == 0)
      points_ = SurfacePoints(scene_->view, options.visibility.points, seed_);
    const LightVisibility visibility(*scene_, lights, points_, options.visibility,
                                     hash64(hash64(seed_ + replicate) + sample), stop);
    const ImsPixels pixels(*scene_, lights, visibility.view(), options);
    const SampleId id{seed_, replicate, 0, sample};
    if (options.mode == ImsOptions::Mode::exact)
      exactPass(pixels, id, stop, frame);
    else
      fastPass(pixels, options, id, stop, frame);
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

  /// Light of x1 alone in each pixel; what else there is, at the coarse pixels, and from them everywhere.
  void fastPass(const ImsPixels& pixels, const ImsOptions& options, SampleId id, std::stop_token stop,
                PassFrame& frame) {
    if (!upsampling_) {
      std::vector<PixelFeatures> features = pictureFeatures(*scene_, stop);
      if (stop.stop_requested()) return;
      upsampling_ = std::make_unique<Upsampling>(std::move(features), frame.width(), frame.height(), options.spacing);
    }
    const std::vector<Upsampling::Pixel>& computed = upsampling_->computed();
    std::vector<Upsampling::Light> light(computed.size());
    parallelFor(static_cast<int64_t>(computed.size()), 4, [&](int64_t i) {
      if (stop.stop_requested()) return;
      const auto n = static_cast<size_t>(i);
      light[n] = indirectLight(pixels, computed[n], options.samples, id);
    });
    upsampling_->spread(light, stop, [&](int x, int y, const Upsampling::Light& indirect) {
      LayerRadiance radiance = pixels.sample(x, y, of(id, x, y), ImsPixels::Part::direct);
      indirect.addTo(radiance);
      radiance += pixels.sampleGlow(x, y, of(id, x, y));
      frame.set(x, y, radiance);
    });
  }

  Upsampling::Light indirectLight(const ImsPixels& pixels, Upsampling::Pixel p, int samples, SampleId id) const {
    Upsampling::Light light;
    const float share = 1 / static_cast<float>(samples);
    for (int s = 0; s < samples; ++s) {
      SampleId own = of(id, p.x, p.y);
      own.index = own.index * static_cast<uint32_t>(samples) + static_cast<uint32_t>(s);
      light.add(pixels.sample(p.x, p.y, own), share);
    }
    return light;
  }

  SampleId of(SampleId id, int x, int y) const {
    id.stream = scene_->camera.pixelStream(x, y);
    return id;
  }
  static Overlay dotsOf(const VirtualLights& lights) {
    constexpr size_t kMost = 4096;
    Overlay overlay;
    for (size_t i = 0; i < std::min(kMost, lights.lights.size()); ++i) {
      const LightVertex& v = lights.lights[i];
      overlay.dots.push_back({v.p, v.kind == VertexKind::surface ? Rgb(0, 1, 0) : Rgb(1, 0, 0)});
    }
    return overlay;
  }

  SceneSnapshot scene_;
  WalkStore walks_;                         ///< from frame to frame, if any are kept
  std::unique_ptr<Upsampling> upsampling_;  ///< of this scene; made when it is needed
  SurfacePoints points_;                    ///< likewise
  FrameRenderer renderer_;                  ///< likewise, for frames
  Overlay overlay_;
  ImsSettings settings_;
  uint64_t seed_ = 0;
};

}  // namespace

std::unique_ptr<Method> createIms() { return std::make_unique<ImsMethod>(); }

}  // namespace virga
