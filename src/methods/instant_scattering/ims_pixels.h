// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/instant_scattering/eye_block.h"
#include "methods/instant_scattering/ims_eye_paths.h"
#include "methods/pixels.h"

namespace virga {

/// Samples of pixels, lit by one set of virtual lights. The scene, the lights and the tables must outlive it.
class ImsPixels {
 public:
  using Part = ImsEyePaths<EmbreeRays>::Part;

  ImsPixels(const Scene& scene, const VirtualLights& lights, const LightVisibilityView& visibility,
            const ImsOptions& options, View<LampTable> lampTables = {})
      : scene_(scene),
        rays_{*scene.surfaceRays, *scene.boundaryRays},
        options_(options),
        paths_(scene_.view, rays_, lights.view(), visibility, options_, lampTables) {}
  ImsPixels(const ImsPixels&) = delete;
  ImsPixels& operator=(const ImsPixels&) = delete;

  /// (x, y): a pixel of the crop window. Safe to call from many threads.
  LayerRadiance sample(int x, int y, const SampleId& id, Part part = Part::all) const {
    if (options_.path.maxDepth == 0) return {};
    Sampler sampler(id);
    const CameraRay camera = sampleCameraRay(scene_, x, y, sampler);
    return paths_.trace(camera, sampler, part);
  }
  /// Is the light of x1 alone found by marching, as by light()?
  bool marches() const { return paths_.marches(); }
  /// The light of x1 straight from lamps in a block's pixels, each with its own random numbers; nothing where an eye is
  /// not plain.
  void light(EyeBlock& block, std::span<Sampler> samplers) const;
  /// Light that x1 gets from lamps by way of mirrors and glass alone, as ImsEyePaths::traceCaustics().
  LayerRadiance sampleCaustics(int x, int y, const SampleId& id) const {
    if (!paths_.anyCaustics()) return {};
    Sampler sampler(id);
    const CameraRay camera = sampleCameraRay(scene_, x, y, sampler);
    return paths_.traceCaustics(camera, sampler);
  }
  /// The light of media that glow, which virtual lights do not carry, in all layers: by paths of its own.
  LayerRadiance sampleGlow(int x, int y, SampleId id) const {
    if (!scene_.view.emissive || options_.path.maxDepth == 0 || options_.show != ImsOptions::Show::picture) return {};
    id.seed ^= kGlowSeed;
    Sampler sampler(id);
    const CameraRay camera = sampleCameraRay(scene_, x, y, sampler);
    return paths_.traceGlow(camera, sampler);
  }

 private:
  /// In smoke that the block has marched side by side.
  void lightSmoke(EyeBlock& block, std::span<Sampler> samplers) const;

  static constexpr uint64_t kGlowSeed = 0x2f8b4a91d6e05c37ull;  // keeps its random numbers apart

  const Scene& scene_;
  EmbreeRays rays_;
  ImsOptions options_;
  ImsEyePaths<EmbreeRays> paths_;  ///< refers to the members above
};

}  // namespace virga
