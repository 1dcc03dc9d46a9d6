// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "methods/instant_scattering/ims_options.h"
#include "methods/instant_scattering/marched_light.h"
#include "methods/instant_scattering/pixel_features.h"
#include "methods/pixels.h"

namespace virga {

/// Samples of pixels, lit by one set of virtual lights: eye paths that gather at each vertex that can be connected to.
/// The scene, the lights and the tables must outlive it.
class ImsPixels {
 public:
  /// The light of lamps in all layers; without those that virtual lights light: x1 alone; in these alone, the others
  /// are not to be used.
  enum class Part { all, direct, indirect };

  ImsPixels(const Scene& scene, const VirtualLights& lights, const LightVisibilityView& visibility,
            const ImsOptions& options, View<LampTable> lampTables = {})
      : scene_(scene),
        rays_{*scene.surfaceRays, *scene.boundaryRays},
        options_(options),
        lampPaths_(of(options.path, PathOptions::Sources::lamps)),
        glowPaths_(of(options.path, PathOptions::Sources::glow)),
        tracer_(scene_.view, rays_, lampPaths_),
        glowTracer_(scene_.view, rays_, glowPaths_),
        gatherer_(scene_.view, rays_, lights, visibility, options_.gather),
        compensation_(scene_.view, rays_, tracer_, gatherer_, options_.compensation),
        marched_(scene_.view, rays_, lampTables) {}
  /// Is the light of lamps found by marching? Not where there are panes, which it does not see through, nor from lamps
  /// in homogeneous media alone: there the tracer's equiangular sampling leaves less noise.
  static bool marches(const SceneView& scene) {
    if (scene.thinGlass) return false;
    const auto isLocal = [](const EmitterView& e) { return e.isLocal(); };
    const auto isHeterogeneous = [](const MediumView& medium) { return !medium.homogeneous; };
    return std::none_of(scene.emitters.begin(), scene.emitters.end(), isLocal) ||
           std::any_of(scene.media.begin(), scene.media.end(), isHeterogeneous);
  }

  ImsPixels(const ImsPixels&) = delete;
  ImsPixels& operator=(const ImsPixels&) = delete;

  /// (x, y): a pixel of the crop window. Safe to call from many threads.
  LayerRadiance sample(int x, int y, const SampleId& id, Part part = Part::all) const {
    if (options_.path.maxDepth == 0) return {};
    Sampler sampler(id);
    const CameraRay camera = sampleCameraRay(scene_, x, y, sampler);
    if (LayerRadiance marched; part == Part::direct && marches_ && march(camera, marched, sampler)) return marched;
    Tracer::Path path = tracer_.start(camera);
    Tracer::Record record;
    path.record = &record;
    // The path finds what clamping takes, or nothing of what virtual lights could light.
    const bool compensates = part != Part::direct && options_.compensate == ImsOptions::Compensate::path &&
                             options_.show == ImsOptions::Show::picture;
    path.lightsX1 = part != Part::indirect;
    path.bound = compensates ? options_.gather.bound : kInfinity;
    for (bool goesOn = true; goesOn;) {
      record.vertex.kind = VertexKind::none;
      const int events = path.depth;
      const LayerRadiance before = path.radiance;
      goesOn = tracer_.extend(path, sampler);
      if (options_.show != ImsOptions::Show::picture) path.radiance = before;  // no light straight from lamps
      if (part == Part::direct)
        goesOn = goesOn && !path.layers.hasX2();
      else if (record.vertex.kind != VertexKind::none)
        lightVertex(record, events, path, sampler);
    }
    return path.radiance;
  }
  /// Is the light of x1 alone found by marching?
  bool marches() const { return marches_; }
  /// What pixel (x, y) shows, by the ray through its middle.
  PixelFeatures features(int x, int y) const { return pixelFeatures(scene_, x, y, options_.eyeSteps); }
  /// Likewise, and the light of x1 alone, by the same ray unless it sees a mirror or glass. Only where marches().
  LayerRadiance sampleMiddle(int x, int y, const SampleId& id, PixelFeatures& features) const {
    MarchedEye eye;
    marchMiddle(scene_, x, y, options_.eyeSteps, eye);
    features = pixelFeatures(eye);
    if (!eye.plain) return sample(x, y, id, Part::direct);
    LayerRadiance radiance;
    Sampler sampler(id);
    RandomNumbers numbers{sampler};
    marched_.add(eye, radiance, numbers);
    return radiance;
  }
  /// The light of media that glow, which virtual lights do not carry, in all layers: by paths of its own.
  LayerRadiance sampleGlow(int x, int y, SampleId id) const {
    if (!scene_.view.emissive || options_.path.maxDepth == 0 || options_.show != ImsOptions::Show::picture) return {};
    id.seed ^= kGlowSeed;
    Sampler sampler(id);
    return glowTracer_.trace(sampleCameraRay(scene_, x, y, sampler), sampler);
  }

 private:
  using Tracer = PathTracer<EmbreeRays>;

  static constexpr uint64_t kGlowSeed = 0x2f8b4a91d6e05c37ull;  // keeps its random numbers apart
  static PathOptions of(PathOptions path, PathOptions::Sources sources) {
    path.sources = sources;
    return path;
  }

  /// False, and nothing added, where the ray meets a mirror, glass or a narrow bsdf first.
  bool march(const CameraRay& camera, LayerRadiance& radiance, Sampler& sampler) const {
    RandomNumbers numbers{sampler};
    MarchedEye eye;
    marchEye(scene_.view, rays_, camera, numbers.shift(), eye, options_.eyeSteps);
    if (eye.plain) marched_.add(eye, radiance, numbers);
    return eye.plain;
  }
  void lightVertex(const Tracer::Record& at, int events, Tracer::Path& path, Sampler& sampler) const {
    KnownSpace known;
    if (options_.show != ImsOptions::Show::compensation)
      known = gatherer_.gather(at, events, path, options_.amount, gatherer_.bound(), sampler);
    if (options_.show != ImsOptions::Show::lost && options_.compensate == ImsOptions::Compensate::sampled)
      compensation_.compensate(at, known, path.layers, events, path.radiance, sampler);
  }

  const Scene& scene_;
  EmbreeRays rays_;
  ImsOptions options_;
  PathOptions lampPaths_, glowPaths_;
  Tracer tracer_;                          ///< refers to the members above
  Tracer glowTracer_;                      ///< likewise
  Gatherer<EmbreeRays> gatherer_;          ///< likewise
  Compensation<EmbreeRays> compensation_;  ///< likewise
  MarchedLight<EmbreeRays> marched_;       ///< likewise
  bool marches_ = marches(scene_.view) && tracer_.mayScatter(0);
};

}  // namespace virga
