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
      : scene_(scene), pixels_(pixels), samples_(options.samples), id_(id), stop_(stop), frame_(frame) {}

  /// What the pixels show.
  void look(std::span<PixelFeatures> features) {
    forEachPixel(frame_, stop_, [&](int x, int y) { features[numberOf(x, y)] = pixels_.features(x, y); });
  }
  /// Likewise; their own light goes into the frame, and fill() adds to it.
  void lookAndLight(std::span<PixelFeatures> features) {
    isLit_ = true;
    forEachPixel(frame_, stop_, [&](int x, int y) {
      LayerRadiance radiance = pixels_.sampleMiddle(x, y, of(x, y), features[numberOf(x, y)]);
      radiance += pixels_.sampleGlow(x, y, of(x, y));
      frame_.set(x, y, radiance);
    });
  }

  void fill(const Upsampling& upsampling) {
    const auto body = [&](int x, int y, const Upsampling::Light& indirect) { show(x, y, indirect); };
    const std::vector<Upsampling::Pixel> others = upsampling.spread(indirectLight(upsampling.coarse()), stop_, body);
    const std::vector<Upsampling::Light> light = indirectLight(others);
    if (stop_.stop_requested()) return;
    for (size_t i = 0; i < others.size(); ++i) show(others[i].x, others[i].y, light[i]);
  }

 private:
  std::vector<Upsampling::Light> indirectLight(std::span<const Upsampling::Pixel> pixels) const {
    std::vector<Upsampling::Light> light(pixels.size());
    parallelFor(static_cast<int64_t>(pixels.size()), 4, [&](int64_t i) {
      if (!stop_.stop_requested()) light[static_cast<size_t>(i)] = indirectLight(pixels[static_cast<size_t>(i)]);
    });
    return light;
  }
  void show(int x, int y, const Upsampling::Light& indirect) const {
    if (isLit_) return indirect.visit([&](Layer layer, Rgb radiance) { frame_.add(x, y, layer, radiance); });
    LayerRadiance radiance = pixels_.sample(x, y, of(x, y), ImsPixels::Part::direct);
    indirect.visit([&](Layer layer, Rgb more) { radiance.add(layer, more); });
    radiance += pixels_.sampleGlow(x, y, of(x, y));
    frame_.set(x, y, radiance);
  }
  Upsampling::Light indirectLight(Upsampling::Pixel p) const {
    Upsampling::Light light;
    const float share = 1 / static_cast<float>(samples_);
    for (int s = 0; s < samples_; ++s) {
      SampleId own = of(p.x, p.y);
      own.index = own.index * static_cast<uint32_t>(samples_) + static_cast<uint32_t>(s);
      light.add(pixels_.sample(p.x, p.y, own, ImsPixels::Part::indirect), share);
    }
    return light;
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
  const ImsPixels& pixels_;
  int samples_;
  SampleId id_;
  const std::stop_token& stop_;
  PassFrame& frame_;
  bool isLit_ = false;
};

}  // namespace

void FastRenderer::forget(const ChangeSet& changes) {
  upsampling_ = nullptr;
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
  const bool lights = id.replicate == 0 && id.index == 0 && pixels.marches();
  if (lights || !upsampling_) {
    const size_t all = static_cast<size_t>(frame.width()) * static_cast<size_t>(frame.height());
    if (features_.size() != all) features_ = LargeArray<PixelFeatures>(all);
    const std::span features(features_.data(), all);
    upsampling_ = nullptr;
    if (lights)
      own.lookAndLight(features);
    else
      own.look(features);
    if (stop.stop_requested()) return;
    upsampling_ = std::make_unique<Upsampling>(features, frame.width(), frame.height(), options.spacing);
  }
  own.fill(*upsampling_);
}

}  // namespace virga
