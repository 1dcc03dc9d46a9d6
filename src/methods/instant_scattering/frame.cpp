// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame.h"

#include "core/parallel.h"
#include "methods/instant_scattering/small_media.h"

namespace virga {
namespace {

/// Pixels that are gathered together: their receivers' arrays and a light's tables stay in the nearest cache.
constexpr int kGroup = 64;

/// Radius of clamping, over that of the balls: what is clamped by a larger one takes more than a level to find again.
constexpr float kClampedShare = 0.7f;

/// One pass with its lights.
class FramePass {
 public:
  FramePass(const Scene& scene, const FrameLights& lights, const FrameLamps& lamps, const ImsOptions& options,
            const SampleId& id)
      : scene_(scene),
        options_(options),
        id_(id),
        pixels_(scene, lights, lamps, options_, id.index),
        paths_(scene, lights.virtualLights(), visibilityOfPaths(options), followed(options)) {}

  /// `features`: room for those of all pixels.
  bool run(const std::stop_token& stop, std::span<PixelFeatures> features, PassFrame& frame) {
    width_ = frame.width();
    lightDirectly(stop, features, frame);
    if (stop.stop_requested()) return false;
    setSmallMediaApart(scene_, options_.spacing, frame.width(), frame.height(), features);
    const auto show = [&](int x, int y, const Upsampling::Light& indirect) {
      indirect.visit([&](Layer layer, Rgb radiance) { frame.add(x, y, layer, radiance); });
    };
    const Upsampling upsampling(features, frame.width(), frame.height(), options_.spacing,
                                coarsePlace(scene_.camera, options_.spacing, id_.index));
    const std::vector<Upsampling::Pixel> others =
        upsampling.spread(indirectLight(upsampling.coarse(), stop), stop, show);
    const std::vector<Upsampling::Light> light = indirectLight(others, stop);
    for (size_t i = 0; i < others.size(); ++i) show(others[i].x, others[i].y, light[i]);
    return !stop.stop_requested();
  }

 private:
  /// What the pixels show, and their own light.
  void lightDirectly(const std::stop_token& stop, std::span<PixelFeatures> features, PassFrame& frame) {
    // Panes are looked through by paths alone, and paths of one segment see lamps alone.
    const bool marches = !scene_.view.thinGlass && (options_.path.maxDepth < 0 || options_.path.maxDepth >= 2);
    forEachBlock(frame, stop, [&](EyeBlock& block) {
      pixels_.direct(block);
      for (size_t i = 0; i < block.count; ++i) {
        const auto [x, y] = block.pixels[i];
        LayerRadiance& radiance = block.radiance[i];
        features[numberOf(x, y)] = block.features(i);
        if (!block.eyes()[i].plain || !marches)
          radiance = paths_.sample(x, y, idOf(x, y), ImsPixels::Part::direct);
        else
          radiance += paths_.sampleCaustics(x, y, idOf(x, y));
        if (scene_.view.emissive) radiance += paths_.sampleGlow(x, y, idOf(x, y));
        frame.set(x, y, radiance);
      }
    });
  }

  std::vector<Upsampling::Light> indirectLight(std::span<const Upsampling::Pixel> computed,
                                               const std::stop_token& stop) const {
    std::vector<Upsampling::Light> light(computed.size());
    const auto groups = (static_cast<int64_t>(computed.size()) + kGroup - 1) / kGroup;
    parallelFor(groups, 1, [&](int64_t n) {
      if (stop.stop_requested()) return;
      const size_t first = static_cast<size_t>(n) * kGroup;
      const auto group = computed.subspan(first, std::min<size_t>(kGroup, computed.size() - first));
      const auto found = pixels_.indirect(group);
      for (size_t i = 0; i < group.size(); ++i) light[first + i] = found[i] ? *found[i] : sampled(group[i]);
    });
    return light;
  }
  /// Of a pixel that sees a mirror, glass or a narrow bsdf: it is left to a few paths, the same in each frame.
  Upsampling::Light sampled(Upsampling::Pixel p) const {
    Upsampling::Light light;
    SampleId id = idOf(p.x, p.y);
    for (int s = 0; s < options_.samples; ++s) {
      id.index = static_cast<uint32_t>(s);
      light.add(paths_.sample(p.x, p.y, id), 1 / static_cast<float>(options_.samples));
    }
    return light;
  }

  static ImsOptions followed(ImsOptions options) {
    options.compensate = ImsOptions::Compensate::path;
    return options;
  }
  static LightVisibilityView visibilityOfPaths(const ImsOptions& options) {
    using Seen = LightVisibilityOptions::Mode;
    return {options.visibility.mode == Seen::none ? Seen::none : Seen::exact};
  }
  SampleId idOf(int x, int y) const {
    SampleId id = id_;
    id.stream = scene_.camera.pixelStream(x, y);
    return id;
  }
  size_t numberOf(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }

  const Scene& scene_;
  ImsOptions options_;
  SampleId id_;
  FramePixels pixels_;  ///< refers to the members above
  ImsPixels paths_;     ///< of pixels that are left to paths
  int width_ = 0;
};

}  // namespace

void FrameRenderer::forget(const ChangeSet& changes, bool walksStay) {
  if (!changes.cameraAlone()) lights_ = nullptr;
  if (!walksStay) kept_.clear();
}

bool FrameRenderer::prepareLights(const Scene& scene, const ImsOptions& options, const SampleId& id, WalkStore& walks,
                                  const std::stop_token& stop) {
  const int around = endlessMedium(scene);
  if (lights_ && lightsOf_ == id.index && around == around_) return true;
  lights_ = nullptr;
  const int maxDepth = options.path.maxDepth < 0 ? -1 : std::max(0, options.path.maxDepth - 2);
  const WalkOptions walk{options.walks, maxDepth, options.flights, options.aim};
  const bool keeps = options.retrace < 1 && WalkStore::keeps(id.index, options.walks);
  VirtualLights traced = keeps ? walks.lights(scene, walk, id, id.index, options.retrace, stop)
                               : traceVirtualLights(scene, walk, id, stop);
  if (stop.stop_requested()) return false;
  FrameLights::Options kept;
  kept.most = options.frameLights;
  kept.balls = !(options.frame.near.bound > 0);
  kept.fitted = options.frame.near.kind == NearField::Kind::spread;
  kept.radius = options.compensation.radius;
  kept.turn = FixedNumbers{id.index}.shift();
  if (options.frame.visibility != ReceiverBatch::Visibility::maps) kept.shadows = FrameLights::ShadowMapping::none;
  kept.maps = {options.visibility.resolution, options.visibility.points};
  FrameLights::Kept none;
  auto lights = std::make_unique<FrameLights>(scene, std::move(traced), kept, keeps ? kept_[id.index] : none, stop);
  auto lamps = std::make_unique<FrameLamps>(scene, id.index, stop);
  if (stop.stop_requested()) return false;
  lamps_ = std::move(lamps);
  lights_ = std::move(lights);
  lightsOf_ = id.index, around_ = around;
  return true;
}

bool FrameRenderer::pass(const Scene& scene, const ImsOptions& options, const SampleId& id, WalkStore& walks,
                         const std::stop_token& stop, PassFrame& frame) {
  if (!prepareLights(scene, options, id, walks, stop)) return false;
  ImsOptions own = options;
  // Of spread lights each has a ball of its own; compensation knows one radius for all.
  if (!(own.frame.near.bound > 0) && own.frame.near.kind == NearField::Kind::clamped)
    own.frame.near.bound = 1 / square(kClampedShare * lights_->medianRadius());
  const size_t pixels = static_cast<size_t>(frame.width()) * static_cast<size_t>(frame.height());
  if (features_.size() != pixels) features_ = LargeArray<PixelFeatures>(pixels);
  return FramePass(scene, *lights_, *lamps_, own, id).run(stop, {features_.data(), pixels}, frame);
}

}  // namespace virga
