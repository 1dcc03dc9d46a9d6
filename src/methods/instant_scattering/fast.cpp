// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/fast.h"

#include "core/parallel.h"

namespace virga {
namespace {

/// Light of the layers that are not upsampled: those before the others.
using DirectLight = std::array<Rgb, static_cast<size_t>(Layer::surfaceToSurface)>;

/// One pass.
class FastPass {
 public:
  FastPass(const Scene& scene, const ImsPixels& pixels, const ImsOptions& options, const SampleId& id,
           const std::stop_token& stop, PassFrame& frame)
      : scene_(scene),
        pixels_(pixels),
        samples_(options.samples),
        id_(id),
        stop_(stop),
        frame_(frame),
        features_(numberOf(0, frame.height())) {}

  /// What the pixels show.
  std::vector<PixelFeatures> look() {
    forEachPixel(frame_, stop_, [&](int x, int y) { features_[numberOf(x, y)] = pixels_.features(x, y); });
    return std::move(features_);
  }
  /// Likewise; their light is kept for fill().
  std::vector<PixelFeatures> lookAndLight() {
    direct_.resize(features_.size());
    forEachPixel(frame_, stop_, [&](int x, int y) {
      const LayerRadiance radiance = pixels_.sampleMiddle(x, y, of(x, y), features_[numberOf(x, y)]);
      std::copy_n(radiance.value, direct_[numberOf(x, y)].size(), direct_[numberOf(x, y)].begin());
    });
    return std::move(features_);
  }

  void fill(const Upsampling& upsampling) {
    const std::vector<Upsampling::Pixel>& computed = upsampling.computed();
    std::vector<Upsampling::Light> light(computed.size());
    parallelFor(static_cast<int64_t>(computed.size()), 4, [&](int64_t i) {
      if (stop_.stop_requested()) return;
      light[static_cast<size_t>(i)] = indirectLight(computed[static_cast<size_t>(i)]);
    });
    upsampling.spread(light, stop_, [&](int x, int y, const Upsampling::Light& indirect) {
      LayerRadiance radiance;
      if (direct_.empty())
        radiance = pixels_.sample(x, y, of(x, y), ImsPixels::Part::direct);
      else
        std::copy_n(direct_[numberOf(x, y)].begin(), direct_[numberOf(x, y)].size(), radiance.value);
      indirect.addTo(radiance);
      radiance += pixels_.sampleGlow(x, y, of(x, y));
      frame_.set(x, y, radiance);
    });
  }

 private:
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
  std::vector<PixelFeatures> features_;
  std::vector<DirectLight> direct_;  ///< of all pixels, where they have been lit already
};

}  // namespace

void FastRenderer::forget(const ChangeSet& changes) {
  upsampling_ = nullptr;
  if (!changes.cameraAlone()) tables_ = nullptr;
}

View<LampTable> FastRenderer::lampTables(const Scene& scene, const ImsOptions& options, const std::stop_token& stop) {
  if (options.lampTable == 0 || !ImsPixels::marches(scene.view)) return {};
  if (!tables_) {
    auto tables = std::make_unique<LampTables>(scene, options.lampTable, stop);
    if (stop.stop_requested()) return {};
    tables_ = std::move(tables);
  }
  return tables_->view();
}

void FastRenderer::pass(const Scene& scene, const ImsPixels& pixels, const ImsOptions& options, const SampleId& id,
                        const std::stop_token& stop, PassFrame& frame) {
  FastPass own(scene, pixels, options, id, stop, frame);
  const bool lights = id.replicate == 0 && id.index == 0 && pixels.marches();
  if (lights || !upsampling_) {
    std::vector<PixelFeatures> features = lights ? own.lookAndLight() : own.look();
    if (stop.stop_requested()) return;
    upsampling_ = std::make_unique<Upsampling>(std::move(features), frame.width(), frame.height(), options.spacing);
  }
  own.fill(*upsampling_);
}

}  // namespace virga
