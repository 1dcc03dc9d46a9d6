// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <vector>

#include "methods/instant_scattering/frame_kernels.h"
#include "transport/virtual_lights.h"

namespace virga {

/// The virtual lights of a frame as its kernels take them. They depend on the scene, not on the camera.
class FrameLights {
 public:
  struct Light {
    KernelLight kernel;
    EndKind kind;
    const LightVertex* vertex;  ///< in virtualLights()
    bool plain;  ///< the kernels know its bsdf or phase function; of others the kernel's light says only where they are
  };

  /// A stop leaves lights out.
  FrameLights(const Scene& scene, VirtualLights lights, const std::stop_token& stop);
  FrameLights(const FrameLights&) = delete;
  FrameLights& operator=(const FrameLights&) = delete;

  const VirtualLights& virtualLights() const { return virtualLights_; }
  /// Those on surfaces, then those in media.
  const std::vector<Light>& lights() const { return lights_; }

  /// Transmittance from light number i to the receivers, for each channel; surfaces are not looked at. `seen` points to
  /// three arrays of to.count values; on return the second and the third may be the same as the first.
  void lookFrom(size_t i, const KernelReceivers& to, float* seen[3]) const;

 private:
  enum class Between { nothing, fog, media };

  void makeTables(const Scene& scene, const std::stop_token& stop);
  void fillTable(const Scene& scene, size_t i);

  VirtualLights virtualLights_;
  std::vector<Light> lights_;
  Between between_ = Between::nothing;
  Rgb fog_;                   ///< extinction of the homogeneous medium that is everywhere [1/unit]
  int channels_ = 1;          ///< that differ
  std::vector<float> depth_;  ///< tables of the first light, channel by channel, of the second...
  std::vector<float> reach_;  ///< of each light's tables
};

/// How the kernels know a phase function, and its g; false if they do not.
bool plainPhase(const PhaseFunction& phase, EndKind& kind, float& g);

}  // namespace virga
