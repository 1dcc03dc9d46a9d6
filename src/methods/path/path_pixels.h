// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/pixel_groups.h"
#include "methods/path/shared_paths.h"
#include "scene/scene.h"

namespace virga {

/// Samples of pixels by path tracing: of single ones, each on its own, or of groups that share paths. The scene must
/// outlive it.
template <class Rays>
class PathPixels {
 public:
  PathPixels(const Scene& scene, const Rays& rays, const PathOptions& options)
      : scene_(scene),
        rays_(rays),
        options_(options),
        tracer_(scene_.view, rays_, options_),
        shared_(scene_.view, rays_, tracer_) {}
  PathPixels(const PathPixels&) = delete;
  PathPixels& operator=(const PathPixels&) = delete;

  /// (x, y): a pixel of the crop window. Safe to call from many threads.
  LayerRadiance sample(int x, int y, const SampleId& id) const {
    if (options_.maxDepth == 0) return {};  // a path of no segment does not even reach a lamp
    Sampler sampler(id);
    return tracer_.trace(sampleCameraRay(scene_, x, y, sampler), sampler);
  }

  /// set(pixel, radiance) for each of a group's pixels, whose paths are shared: only where SharedPaths::possible().
  /// The stream of `id` is of no concern: each pixel has its own.
  template <class Set>
  void sampleGroup(std::span<const PixelAt> pixels, SampleId id, const Set& set) const {
    std::array<CameraRay, PixelGroups::kMostPixels> cameras;
    std::array<LayerRadiance, PixelGroups::kMostPixels> radiance;
    std::vector<Sampler> samplers;
    samplers.reserve(pixels.size());
    for (size_t i = 0; i < pixels.size(); ++i) {
      id.stream = scene_.camera.pixelStream(pixels[i].x, pixels[i].y);
      samplers.emplace_back(id);
      cameras[i] = sampleCameraRay(scene_, pixels[i].x, pixels[i].y, samplers[i]);
    }
    shared_.trace(cameras.data(), samplers.data(), static_cast<int>(pixels.size()), radiance.data());
    for (size_t i = 0; i < pixels.size(); ++i) set(pixels[i], radiance[i]);
  }

 private:
  static_assert(PixelGroups::kMostPixels <= SharedPaths<Rays>::kMost);

  const Scene& scene_;
  Rays rays_;
  PathOptions options_;
  PathTracer<Rays> tracer_;   ///< refers to the members above
  SharedPaths<Rays> shared_;  ///< likewise
};

}  // namespace virga
