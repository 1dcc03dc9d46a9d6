// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>

#include "methods/instant_scattering/lamp_kernels.h"
#include "methods/instant_scattering/marched_light.h"
#include "methods/instant_scattering/media_between.h"

namespace virga {

/// Fixed points of the lamps, and what the media let through from them. They depend on the scene, not on the camera.
class FrameLamps {
 public:
  /// A stop leaves tables undefined.
  FrameLamps(const Scene& scene, const FixedNumbers& numbers, const std::stop_token& stop);

  const LampPoints& points() const { return points_; }
  /// A single lamp without an extent: all points are the same, and surfaces need one.
  bool allAlike() const { return allAlike_; }
  /// The light of any pixel can be found by packets: all lamps are points or areas.
  bool alone() const { return points_.alone; }

  /// Media that are bounded and homogeneous: the way to a lamp is known exactly, a stretch at a time.
  bool marches() const { return marches_; }
  /// Transmittance from point number k, where it does not march; as MediaBetween::look().
  void look(int k, const KernelReceivers& to, float* seen[3]) const {
    between_.look(allAlike_ ? 0 : static_cast<size_t>(k), to, seen);
  }

 private:
  LampPoints points_;
  bool allAlike_ = false, marches_ = false;
  MediaBetween between_;
};

}  // namespace virga
