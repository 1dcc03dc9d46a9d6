// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "methods/instant_scattering/eye_packet.h"
#include "methods/instant_scattering/frame_lamps.h"

namespace virga {

/// Light straight from lamps in neighbouring pixels of a frame at once: each fixed point of a lamp lights all of them,
/// by a packet of rays. What packets do not know (lamps at infinity, bsdfs other than diffuse ones, surfaces close to a
/// lamp) goes by MarchedLight, pixel by pixel.
class LampPackets {
 public:
  static constexpr int kSize = RayPacket::kSize;

  /// All of these must outlive it.
  LampPackets(const Scene& scene, const EmbreeRays& rays, const FrameLamps& lamps, const FixedNumbers& numbers)
      : scene_(scene.view), rays_(rays), lamps_(lamps), numbers_(numbers), marched_(scene.view, rays) {}

  /// Does add() know what to do with smoke?
  bool lightSmoke() const { return lamps_.alone() && !lamps_.marches(); }
  /// Adds light of x1 to each radiance, for those eyes that are plain; kSize at most. `smoke`: what it holds of them
  /// is not in their steps.
  void add(std::span<const MarchedEye> eyes, const EyePacket& smoke, std::span<LayerRadiance> radiance) const;

 private:
  using Lanes = float[kSize];
  /// For each channel.
  struct Seen {
    alignas(64) Lanes channel[3];
  };

  void lightSurfaces(std::span<const MarchedEye> eyes, std::span<LayerRadiance> radiance) const;
  void lightFog(std::span<const MarchedEye> eyes, std::span<LayerRadiance> radiance) const;
  void lightSmoke(std::span<const MarchedEye> eyes, const EyePacket& smoke, std::span<LayerRadiance> radiance) const;
  void lightMedia(std::span<const MarchedEye> eyes, std::span<LayerRadiance> radiance) const;
  /// A place in media on each eye ray.
  struct MediaPlaces : KernelPlaces {
    Rgb weight[kSize];
    const MediaState* media[kSize];  ///< none where the ray has no such place
  };
  /// By one point of a lamp.
  void lightMedia(const FrameLamps::Turn& turn, std::span<const MarchedEye> eyes, const MediaPlaces& at,
                  std::span<LayerRadiance> radiance) const;
  /// The n-th of `places` on an eye ray, as a share of it.
  float along(int n, int places) const {
    return (static_cast<float>(n) + numbers_.shift()) / static_cast<float>(places);
  }
  /// Visibility times transmittance from a lamp's point to places, along the rays that were made for them.
  /// mediaRay(lane): such a ray, with the media at its start.
  template <class MediaRayOf>
  Seen see(int lamp, const KernelPlaces& places, const RayPacket& rays, const MediaRayOf& mediaRay) const;
  bool isFog(const MarchedEye& eye) const;
  bool isLitByPackets(const MarchedEye& eye) const;

  const SceneView& scene_;
  const EmbreeRays& rays_;
  const FrameLamps& lamps_;
  const FixedNumbers& numbers_;
  MarchedLight<EmbreeRays> marched_;
};

}  // namespace virga
