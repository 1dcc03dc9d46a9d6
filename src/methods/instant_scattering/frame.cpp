// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame.h"

#include "core/parallel.h"

namespace virga {
namespace {

/// Pixels that are gathered together: their receivers' arrays and a light's tables stay in the nearest cache.
constexpr int kGroup = 32;

/// Radius of a light that is spread, in spacings of the lights.
constexpr float kRadiusSpacings = 2;

/// The layers that are not upsampled: those before the others.
constexpr int kDirectLayers = static_cast<int>(Layer::surfaceToSurface);
using DirectLight = std::array<Rgb, kDirectLayers>;

/// Of a pixel that sees a mirror, glass or a narrow bsdf: it is left to a few paths, the same in each frame.
Upsampling::Light sampled(const ImsPixels& pixels, Upsampling::Pixel p, SampleId id, int samples) {
  Upsampling::Light light;
  const float share = 1 / static_cast<float>(samples);
  for (int s = 0; s < samples; ++s) {
    id.index = static_cast<uint32_t>(s);
    const LayerRadiance r = pixels.sample(p.x, p.y, id);
    light.surface[0] += r.value[static_cast<int>(Layer::surfaceToSurface)] * share;
    light.surface[1] += r.value[static_cast<int>(Layer::mediaToSurface)] * share;
    light.media[0] += r.value[static_cast<int>(Layer::surfaceToMedia)] * share;
    light.media[1] += r.value[static_cast<int>(Layer::mediaToMedia)] * share;
  }
  return light;
}

}  // namespace

void FrameRenderer::forget(const ChangeSet& changes) {
  const std::vector<Change>& all = changes.changes;
  const bool cameraAlone =
      std::all_of(all.begin(), all.end(), [](const Change& change) { return change.aspect == Aspect::camera; });
  if (!cameraAlone) lights_ = nullptr;
}

bool FrameRenderer::prepareLights(const Scene& scene, const ImsOptions& options, uint64_t seed, uint32_t index,
                                  const std::stop_token& stop) {
  const int around = endlessMedium(scene);
  if (lights_ && lightsOf_ == index && around == around_) return true;
  lights_ = nullptr;
  const int maxDepth = options.path.maxDepth < 0 ? -1 : std::max(0, options.path.maxDepth - 2);
  VirtualLights traced =
      traceVirtualLights(scene, {options.walks, maxDepth, options.flights}, {seed, 0, 0, index}, stop);
  FrameLights::Options kept;
  kept.most = options.frameLights;
  kept.turn = FixedNumbers{index}.shift();
  if (options.frame.visibility != ReceiverBatch::Visibility::maps) kept.shadows = FrameLights::ShadowMapping::none;
  kept.resolution = options.visibility.resolution, kept.points = options.visibility.points;
  auto lights = std::make_unique<FrameLights>(scene, std::move(traced), kept, stop);
  if (stop.stop_requested()) return false;
  lights_ = std::move(lights);
  lightsOf_ = index, around_ = around;
  return true;
}

bool FrameRenderer::pass(const Scene& scene, const ImsOptions& options, uint64_t seed, uint32_t index,
                         const std::stop_token& stop, PassFrame& frame) {
  if (!prepareLights(scene, options, seed, index, stop)) return false;
  ImsOptions own = options;
  const float spacing = lights_->spacing();  // none, if they all lie in a plane
  if (!(own.frame.near.bound > 0))
    own.frame.near.bound = spacing > 0 ? 1 / square(kRadiusSpacings * spacing) : own.gather.bound;
  const FramePixels pixels(scene, *lights_, own, index);
  own.compensate = ImsOptions::Compensate::path;  // of pixels that are left to paths
  using Seen = LightVisibilityOptions::Mode;
  const LightVisibilityView visibility{options.visibility.mode == Seen::none ? Seen::none : Seen::exact};
  const ImsPixels paths(scene, lights_->virtualLights(), visibility, own);
  const auto idOf = [&](int x, int y) { return SampleId{seed, 0, scene.camera.pixelStream(x, y), index}; };
  const auto numberOf = [&](int x, int y) {
    return static_cast<size_t>(y) * static_cast<size_t>(frame.width()) + static_cast<size_t>(x);
  };

  // Panes are looked through by paths alone, and paths of one segment see lamps alone.
  const bool marches = !scene.view.thinGlass && (options.path.maxDepth < 0 || options.path.maxDepth >= 2);
  const size_t all = numberOf(0, frame.height());
  std::vector<PixelFeatures> features(all);
  std::vector<DirectLight> direct(all);
  forEachPixel(frame, stop, [&](int x, int y) {
    LayerRadiance radiance;
    if (!pixels.direct(x, y, features[numberOf(x, y)], radiance) || !marches)
      radiance = paths.sample(x, y, idOf(x, y), ImsPixels::Part::direct);
    std::copy_n(radiance.value, kDirectLayers, direct[numberOf(x, y)].begin());
  });
  if (stop.stop_requested()) return false;
  const Upsampling upsampling(std::move(features), frame.width(), frame.height(), options.spacing);

  const std::vector<Upsampling::Pixel>& computed = upsampling.computed();
  std::vector<Upsampling::Light> light(computed.size());

  const auto groups = (static_cast<int64_t>(computed.size()) + kGroup - 1) / kGroup;
  parallelFor(groups, 1, [&](int64_t n) {
    if (stop.stop_requested()) return;
    const size_t first = static_cast<size_t>(n) * kGroup, count = std::min<size_t>(kGroup, computed.size() - first);
    const auto found = pixels.indirect({&computed[first], count});
    for (size_t i = 0; i < count; ++i) {
      const Upsampling::Pixel p = computed[first + i];
      light[first + i] = found[i] ? Upsampling::Light{found[i]->surface, found[i]->media}
                                  : sampled(paths, p, idOf(p.x, p.y), options.samples);
    }
  });
  forEachPixel(frame, stop, [&](int x, int y) {
    LayerRadiance radiance;
    std::copy_n(direct[numberOf(x, y)].begin(), kDirectLayers, radiance.value);
    const Upsampling::Light found = upsampling.at(light, x, y);
    radiance.add(Layer::surfaceToSurface, found.surface[0]);
    radiance.add(Layer::mediaToSurface, found.surface[1]);
    radiance.add(Layer::surfaceToMedia, found.media[0]);
    radiance.add(Layer::mediaToMedia, found.media[1]);
    radiance += paths.sampleGlow(x, y, idOf(x, y));
    frame.set(x, y, radiance);
  });
  return !stop.stop_requested();
}

}  // namespace virga
