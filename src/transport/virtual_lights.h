// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <vector>

#include "scene/scene.h"
#include "transport/emitted_ray.h"
#include "transport/virtual_lights_view.h"

namespace virga {

/// Virtual point lights: where random walks from the lights scatter, walk after walk.
struct VirtualLights {
  std::vector<LightVertex> lights;
  std::vector<SurfaceScattering> surfaces;  ///< LightVertex::surface counts these
  std::vector<uint32_t> firstOf;            ///< of each walk, the first of its lights; one more entry than walks

  int walks() const { return static_cast<int>(firstOf.size()) - 1; }
  VirtualLightsView view() const { return {viewOf(lights), viewOf(surfaces), viewOf(firstOf)}; }
};

/// One list after the other.
VirtualLights joined(const std::vector<VirtualLights>& parts);

struct WalkOptions {
  int walks = 1024;
  int maxDepth = -1;  ///< scattering events; -1: no limit
  FlightMode flights = FlightMode::tracking;
  float aimed = 0;  ///< in [0, 1): the share of walks that start toward the media, if these do not fill the scene
};

/// Walks number 0, 1, ... of a scene, the same for every number of threads. `id` names the set: its stream is not used,
/// each walk has one of its own, so that the same walk in two sets of one replicate takes part in one low-discrepancy
/// sequence. The flux of a vertex is that of its walk: divide by the number of walks. A
/// stop leaves walks out.
VirtualLights traceVirtualLights(const Scene& scene, const WalkOptions& options, const SampleId& id,
                                 const std::stop_token& stop = {});

/// Index of the medium that is around everything: one that the sensor declares and in whose shape it does not lie;
/// MediaState::kNone where there is none.
int endlessMedium(const Scene& scene);
/// The same, unless it ends by itself.
int mediumWithoutEnd(const Scene& scene);

/// Spheres around the parts of the media that lie apart, at which a share of the walks is aimed; a medium without end
/// is no such part. They do not depend on the camera, which may move among the lights.
EmissionTargets mediaTargets(const Scene& scene, float share);

/// Where walks start: rays from lights that are chosen by power. The scene must outlive it.
///
/// Media without end let all light from infinity through or none, channel by channel. Where a grid is around everything
/// walks start outside of its values, though these may lie beyond all shapes.
class WalkStarts {
 public:
  /// `targets`: where some of the walks are aimed.
  explicit WalkStarts(const Scene& scene, const EmissionTargets& targets = {});

  struct Start {
    MediaRay at;
    Rgb flux;  ///< [W]; black if no walk leaves
  };
  Start sample(Sampler& sampler) const;
  /// Would walks that have started here be walks of `next`, too, which has the same emitters and shapes?
  bool serve(const WalkStarts& next) const;

 private:
  const Scene& scene_;
  EmissionTargets targets_;
  int endless_;
  Bounds reach_;  ///< all that light from infinity is to meet
};

}  // namespace virga
