// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/ims_method.h"

#include <fmt/format.h>

#include "core/parallel.h"
#include "methods/instant_scattering/gather.h"
#include "methods/settings_reader.h"

namespace virga {
namespace {

struct ImsOptions {
  PathOptions path;
  GatherOptions gather;
  int walks = 0;
};

/// Samples of pixels, lit by one set of virtual lights.
class ImsPixels {
 public:
  ImsPixels(const Scene& scene, const VirtualLights& lights, const ImsOptions& options)
      : scene_(scene),
        rays_{*scene.surfaceRays, *scene.boundaryRays},
        options_(options),
        tracer_(scene_.view, rays_, options_.path),
        gatherer_(scene_.view, rays_, lights, options_.gather) {}
  ImsPixels(const ImsPixels&) = delete;
  ImsPixels& operator=(const ImsPixels&) = delete;

  LayerRadiance sample(int x, int y, const SampleId& id) const {
    if (options_.path.maxDepth == 0) return {};
    Sampler sampler(id);
    const Vec2 offset = scene_.filter.sample(sampler.next2D());
    auto path = tracer_.start(
        scene_.camera.ray(static_cast<float>(x) + 0.5f + offset.x, static_cast<float>(y) + 0.5f + offset.y));
    Tracer::Record record;
    path.record = &record;
    path.bound = options_.gather.bound;
    for (bool goesOn = true; goesOn;) {
      record.vertex.kind = VertexKind::none;
      const int events = path.depth;
      goesOn = tracer_.extend(path, sampler);
      if (record.vertex.kind != VertexKind::none) gatherer_.gather(record, events, path, sampler);
    }
    return path.radiance;
  }

 private:
  using Tracer = PathTracer<EmbreeRays>;

  const Scene& scene_;
  EmbreeRays rays_;
  ImsOptions options_;
  Tracer tracer_;                  ///< refers to the members above
  Gatherer<EmbreeRays> gatherer_;  ///< likewise
};

class ImsMethod final : public Method {
 public:
  void prepare(SceneSnapshot scene, const Settings& settings, LayerMask) override {
    scene_ = std::move(scene);
    SettingsReader reader(settings, kImsSettings, "ims");
    walks_ = reader.integer("walks", 1).value_or(8192);
    lights_ = reader.integer("lights", 1).value_or(4);
    radius_ = reader.number("radius", 0);
    maxDepth_ = reader.integer("max_depth", -1);
    rrDepth_ = reader.integer("rr_depth", 1);
    seed_ = settings.seed;
    refuse();
  }

  Reset update(SceneSnapshot next, const ChangeSet& changes) override {
    scene_ = std::move(next);
    refuse();
    return changes.empty() ? Reset::nothingLost : Reset::film;
  }

  SettingValues settingsInForce() const override {
    const ImsOptions o = options();
    return {{"walks", std::to_string(o.walks)},
            {"lights", std::to_string(o.gather.lights)},
            {"radius", fmt::format("{}", 1 / std::sqrt(o.gather.bound))},
            {"max_depth", std::to_string(o.path.maxDepth)},
            {"rr_depth", std::to_string(o.path.rrDepth)}};
  }

  PassResult pass(int64_t index, const Budget&, std::stop_token stop, PassFrame& frame) override {
    const ImsOptions o = options();
    const auto replicate = static_cast<uint32_t>(index % Film::kReplicates);
    const auto sample = static_cast<uint32_t>(index / Film::kReplicates);
    const VirtualLights lights =
        traceVirtualLights(*scene_, {o.walks, o.path.maxDepth < 0 ? -1 : std::max(0, o.path.maxDepth - 2)},
                           {seed_ ^ kWalkSeed, replicate, 0, sample});
    const ImsPixels pixels(*scene_, lights, o);
    constexpr int kTile = 16;
    const int tilesX = (frame.width() + kTile - 1) / kTile, tilesY = (frame.height() + kTile - 1) / kTile;
    parallelFor(int64_t{tilesX} * tilesY, 1, [&](int64_t tile) {
      const int x0 = static_cast<int>(tile % tilesX) * kTile, y0 = static_cast<int>(tile / tilesX) * kTile;
      for (int y = y0; y < std::min(y0 + kTile, frame.height()); ++y)
        for (int x = x0; x < std::min(x0 + kTile, frame.width()) && !stop.stop_requested(); ++x)
          frame.set(x, y, pixels.sample(x, y, {seed_, replicate, scene_->camera.pixelStream(x, y), sample}));
    });
    return {.completed = !stop.stop_requested()};
  }

 private:
  /// Keeps the walks' random numbers apart from the pixels'.
  static constexpr uint64_t kWalkSeed = 0x6c62272e07bb0142ull;

  ImsOptions options() const {
    ImsOptions o;
    o.path.maxDepth = maxDepth_.value_or(scene_->integrator.maxDepth);
    o.path.rrDepth = rrDepth_.value_or(scene_->integrator.rrDepth);
    const float radius = radius_.value_or(0.1f * maxComponent(scene_->view.bounds.extent()));
    o.gather = {.bound = 1 / (radius * radius), .lights = lights_, .maxDepth = o.path.maxDepth};
    o.walks = walks_;
    return o;
  }
  void refuse() const {
    if (scene_->view.emissive)
      throw Error("method \"ims\" does not carry the light of media that glow", {{}, "render with --method path", {}});
  }

  SceneSnapshot scene_;
  int walks_ = 0, lights_ = 0;
  std::optional<float> radius_;
  std::optional<int> maxDepth_, rrDepth_;
  uint64_t seed_ = 0;
};

}  // namespace

std::unique_ptr<Method> createIms() { return std::make_unique<ImsMethod>(); }

}  // namespace virga
