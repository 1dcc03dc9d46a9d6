// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <stop_token>
#include <vector>

#include "methods/instant_scattering/light_choice.h"
#include "methods/instant_scattering/light_maps.h"
#include "methods/instant_scattering/media_between.h"
#include "transport/virtual_lights.h"

namespace virga {

/// The virtual lights of a frame as its kernels take them. They depend on the scene, not on the camera.
class FrameLights {
 public:
  enum class ShadowMapping { none, maps };
  struct Options {
    int most = 1300;  ///< lights that are kept, half of them on surfaces where there are enough
    ShadowMapping shadows = ShadowMapping::maps;
    LightMaps::Options maps;
    bool balls = true;   ///< each has a radius of its own
    bool fitted = true;  ///< and one that keeps its light in the media
    float radius = 1;    ///< of lights that have no neighbours [unit]
    float turn = 0.5f;   ///< in [0, 1): which ones
  };
  /// What the lights of a frame leave to those of the next one, if these are of the same walks among the same surfaces.
  struct Kept {
    LightChoice onSurfaces, inMedia;
    std::shared_ptr<const LightMaps> maps;
  };
  struct Light {
    KernelLight kernel;
    EndKind kind;
    const LightVertex* vertex;  ///< in virtualLights()
    float share;                ///< by which the vertex's weight counts
    float radius;               ///< of the ball that it is spread over, where the user gives none [unit]
    KernelRgb core;             ///< NearField::core for that
    bool plain;  ///< the kernels know its bsdf or phase function; of others the kernel's light says only where they are
  };

  /// Of many lights few are kept, evenly in space and by their weight; all of these stand for as much light, and in
  /// expectation they light as all would. A stop leaves tables and maps undefined.
  FrameLights(const Scene& scene, VirtualLights lights, const Options& options, Kept& kept,
              const std::stop_token& stop);
  FrameLights(const FrameLights&) = delete;
  FrameLights& operator=(const FrameLights&) = delete;

  const VirtualLights& virtualLights() const { return virtualLights_; }
  /// Those on surfaces, then those in media.
  const std::vector<Light>& lights() const { return lights_; }

  /// Of the lights in media, or of all where there are none there [unit].
  float medianRadius() const;

  /// Transmittance from light number i to receivers of a kind, for each channel; surfaces are looked at where there are
  /// shadow maps. `seen` points to three arrays of to.count values; on return the second and the third may be the same
  /// as the first.
  void lookFrom(size_t i, const KernelReceivers& to, EndKind kind, float* seen[3]) const;
  /// Does all that lookFrom() and gatherLight() would, for a plain light; false, and nothing done, where media are not
  /// grey or lie far apart, or there are no shadow maps.
  bool gatherAtOnce(size_t i, const KernelReceivers& to, EndKind kind, const NearField& near) const;

 private:
  VirtualLights virtualLights_;
  std::vector<Light> lights_;
  MediaBetween between_;
  std::shared_ptr<const LightMaps> maps_;  ///< null: there are none
};

/// How the kernels know a phase function, and its g; false if they do not.
bool plainPhase(const PhaseFunction& phase, EndKind& kind, float& g);

}  // namespace virga
