// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/fast.h"

#include "core/parallel.h"

namespace virga {
namespace {

/// One pass.
class FastPass {
 public:
  FastPass(const Scene& scene, const ImsPixels& pixels, const ImsOptions& options, const SampleId& id,
           const std::stop_token& stop, PassFrame& frame)
      : scene_(scene),
        rays_{*scene.surfaceRays, *scene.boundaryRays},
        pixels_(pixels),
        options_(options),
        id_(id),
        stop_(stop),
        frame_(frame) {}

  /// What the pixels show in their middles.
  void look(std::span<PixelFeatures> features) {
    forEachBlock(frame_, stop_, [&](EyeBlock& block) {
      lookAtMiddles(block);
      takeFeatures(block, features);
    });
  }
  /// Likewise, and their own light, by the same rays.
  void lookAndLight(std::span<PixelFeatures> features) {
    forEachBlock(frame_, stop_, [&](EyeBlock& block) {
      lookAtMiddles(block);
      takeFeatures(block, features);
      std::vector<Sampler> samplers = samplersOf(block);
      light(block, samplers);
    });
  }
  /// The light of x1 alone, to which fill() adds.
  void light() {
    if (!pixels_.marches()) return forEachPixel(frame_, stop_, [&](int x, int y) { show(x, y, followed(x, y)); });
    forEachBlock(frame_, stop_, [&](EyeBlock& block) {
      std::vector<Sampler> samplers = samplersOf(block);
      size_t n = 0;
      block.look(scene_.view, rays_, options_.eyeSteps, true, [&](EyeBlock::Pixel p) {
        Sampler& sampler = samplers[n++];
        const CameraRay camera = sampleCameraRay(scene_, p.x, p.y, sampler);
        return EyeStart{camera, sampler.random()};
      });
      light(block, samplers);
    });
  }

  void fill(const Upsampling& upsampling) {
    const auto add = [&](int x, int y, const Upsampling::Light& indirect) {
      indirect.visit([&](Layer layer, Rgb radiance) { frame_.add(x, y, layer, radiance); });
    };
    const std::vector<Upsampling::Pixel> others = upsampling.spread(indirectLight(upsampling.coarse()), stop_, add);
    const std::vector<Upsampling::Light> light = indirectLight(others);
    if (stop_.stop_requested()) return;
    for (size_t i = 0; i < others.size(); ++i) add(others[i].x, others[i].y, light[i]);
  }

 private:
  void lookAtMiddles(EyeBlock& block) const {
    block.look(scene_.view, rays_, options_.eyeSteps, true,
               [&](EyeBlock::Pixel p) { return middleOf(scene_, p.x, p.y); });
  }
  void takeFeatures(const EyeBlock& block, std::span<PixelFeatures> features) const {
    for (size_t i = 0; i < block.count; ++i)
      features[numberOf(block.pixels[i].x, block.pixels[i].y)] = block.features(i);
  }
  void light(EyeBlock& block, std::span<Sampler> samplers) const {
    std::fill_n(block.radiance.begin(), block.count, LayerRadiance());
    pixels_.light(block, samplers);
    for (size_t i = 0; i < block.count; ++i) {
      const auto [x, y] = block.pixels[i];
      LayerRadiance& radiance = block.radiance[i];
      if (block.eyes()[i].plain)
        radiance += pixels_.sampleCaustics(x, y, of(x, y));
      else
        radiance = followed(x, y);
      show(x, y, radiance);
    }
  }
  /// Light of x1 alone, by a path.
  LayerRadiance followed(int x, int y) const { return pixels_.sample(x, y, of(x, y), ImsPixels::Part::direct); }
  void show(int x, int y, LayerRadiance direct) const {
    direct += pixels_.sampleGlow(x, y, of(x, y));
    frame_.set(x, y, direct);
  }

  std::vector<Upsampling::Light> indirectLight(std::span<const Upsampling::Pixel> pixels) const {
    std::vector<Upsampling::Light> light(pixels.size());
    parallelFor(static_cast<int64_t>(pixels.size()), 4, [&](int64_t i) {
      if (!stop_.stop_requested()) light[static_cast<size_t>(i)] = indirectLight(pixels[static_cast<size_t>(i)]);
    });
    return light;
  }
  Upsampling::Light indirectLight(Upsampling::Pixel p) const {
    Upsampling::Light light;
    const float share = 1 / static_cast<float>(options_.samples);
    for (int s = 0; s < options_.samples; ++s) {
      SampleId own = of(p.x, p.y);
      own.index = own.index * static_cast<uint32_t>(options_.samples) + static_cast<uint32_t>(s);
      light.add(pixels_.sample(p.x, p.y, own, ImsPixels::Part::indirect), share);
    }
    return light;
  }
  std::vector<Sampler> samplersOf(const EyeBlock& block) const {
    std::vector<Sampler> samplers;
    for (size_t i = 0; i < block.count; ++i) samplers.emplace_back(of(block.pixels[i].x, block.pixels[i].y));
    return samplers;
  }
  SampleId of(int x, int y) const {
    SampleId id = id_;
    id.stream = scene_.camera.pixelStream(x, y);
    return id;
  }
  size_t numberOf(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(frame_.width()) + static_cast<size_t>(x);
  }

  const Scene& scene_;
  EmbreeRays rays_;
  const ImsPixels& pixels_;
  const ImsOptions& options_;
  SampleId id_;
  const std::stop_token& stop_;
  PassFrame& frame_;
};

}  // namespace

void FastRenderer::forget(const ChangeSet& changes) {
  known_ = false;
  if (!changes.cameraAlone()) tables_ = nullptr;
}

View<LampTable> FastRenderer::lampTables(const Scene& scene, const ImsOptions& options, const std::stop_token& stop) {
  if (options.lampTable == 0 || !marchesLamps(scene.view)) return {};
  const int around = endlessMedium(scene);
  if (!tables_ || around != around_) {
    auto tables = std::make_unique<LampTables>(scene, options.lampTable, stop);
    if (stop.stop_requested()) return {};
    tables_ = std::move(tables), around_ = around;
  }
  return tables_->view();
}

void FastRenderer::pass(const Scene& scene, const ImsPixels& pixels, const ImsOptions& options, const SampleId& id,
                        const std::stop_token& stop, PassFrame& frame) {
  FastPass own(scene, pixels, options, id, stop, frame);
  // The first pass looks at the middles of pixels: one march for what a pixel shows and for its light.
  const bool atMiddles = id.replicate == 0 && id.index == 0 && pixels.marches();
  const size_t all = static_cast<size_t>(frame.width()) * static_cast<size_t>(frame.height());
  if (features_.size() != all) features_ = LargeArray<PixelFeatures>(all), known_ = false;
  const std::span features(features_.data(), all);
  if (atMiddles)
    own.lookAndLight(features);
  else if (!known_)
    own.look(features);
  if (stop.stop_requested()) return;
  known_ = true;
  if (!atMiddles) own.light();
  if (stop.stop_requested()) return;
  const uint32_t number = id.index * Film::kReplicates + id.replicate;
  own.fill(
      {features, frame.width(), frame.height(), options.spacing, coarsePlace(scene.camera, options.spacing, number)});
}

}  // namespace virga
