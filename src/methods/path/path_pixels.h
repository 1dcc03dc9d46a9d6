// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/path_tracer.h"
#include "methods/pixels.h"
#include "scene/scene.h"

namespace virga {

/// Samples of single pixels by path tracing, each on its own: for a whole picture, or for a few pixels of one. The
/// scene must outlive it.
class PathPixels {
 public:
  PathPixels(const Scene& scene, const PathOptions& options)
      : scene_(scene),
        rays_{*scene.surfaceRays, *scene.boundaryRays},
        options_(options),
        tracer_(scene_.view, rays_, options_) {}
  PathPixels(const PathPixels&) = delete;
  PathPixels& operator=(const PathPixels&) = delete;

  /// (x, y): a pixel of the crop window. Safe to call from many threads.
  LayerRadiance sample(int x, int y, const SampleId& id) const {
    if (options_.maxDepth == 0) return {};  // a path of no segment does not even reach a lamp
    Sampler sampler(id);
    return tracer_.trace(sampleCameraRay(scene_, x, y, sampler), sampler);
  }

 private:
  const Scene& scene_;
  EmbreeRays rays_;
  PathOptions options_;
  PathTracer<EmbreeRays> tracer_;  ///< refers to the members above
};

}  // namespace virga
