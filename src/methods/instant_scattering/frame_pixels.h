// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "methods/instant_scattering/eye_block.h"
#include "methods/instant_scattering/ims_options.h"
#include "methods/instant_scattering/lamp_packets.h"
#include "methods/instant_scattering/receivers.h"
#include "methods/instant_scattering/upsampling.h"

namespace virga {

/// Pixels of a frame: functions of the scene, the camera and the virtual lights, of fixed points. What is left to paths
/// is not theirs. All of these must outlive it. Safe to call from many threads.
class FramePixels {
 public:
  /// `pass` turns the fixed numbers: passes that are averaged look at different points.
  FramePixels(const Scene& scene, const FrameLights& lights, const FrameLamps& lamps, const ImsOptions& options,
              uint32_t pass)
      : scene_(scene),
        rays_{*scene.surfaceRays, *scene.boundaryRays},
        lights_(lights),
        options_(options),
        numbers_(lamps.numbers(pass)),
        offset_(scene.filter.sample(numbers_.place())),
        packets_(scene_, rays_, lamps, numbers_) {}
  FramePixels(const FramePixels&) = delete;
  FramePixels& operator=(const FramePixels&) = delete;

  using Pixel = Upsampling::Pixel;

  /// Looks along a block's eye rays, and finds the light of x1 straight from lamps. None is found where an eye is not
  /// plain: where a mirror, glass or a narrow bsdf is seen.
  void direct(EyeBlock& block) const;

  /// Light that the virtual lights send by way of each pixel's x1; nothing where an eye is not plain.
  std::vector<std::optional<Upsampling::Light>> indirect(std::span<const Pixel> pixels) const;

 private:
  /// The points of a pixel's eye ray that are lit.
  template <class Visit>
  void visitReceivers(const MarchedEye& eye, Visit&& visit) const;
  CameraRay cameraRay(int x, int y) const;
  /// Fixed numbers of receiver `receiver` of a pixel, for findNearby().
  NearbyNumbers nearbyNumbers(Pixel p, int receiver) const;
  /// A vertex that finds what clamping takes from a receiver; false where there is nothing.
  bool findNearby(const Receiver& from, Pixel pixel, int number, Receiver& next) const;

  const Scene& scene_;
  EmbreeRays rays_;
  const FrameLights& lights_;
  const ImsOptions& options_;
  FixedNumbers numbers_;
  Vec2 offset_;          ///< of all camera rays from the middle of their pixel [pixels]
  LampPackets packets_;  ///< refers to the members above
};

}  // namespace virga
