// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "methods/instant_scattering/frame_kernels.h"
#include "scene/scene.h"
#include "transport/media_walk.h"

namespace virga {

/// Transmittance from a set of fixed points to any others: exact where one fog is everywhere, from tables of optical
/// depth elsewhere.
class MediaBetween {
 public:
  struct Options {
    int side = 12;   ///< of a table: directions along an octahedral map's edge
    int radii = 24;  ///< and distances
    int parts = 8;   ///< at most
  };
  /// How the media between two points are known.
  enum class Kind { nothing, fog, tables };

  MediaBetween() = default;
  /// A stop leaves tables undefined.
  MediaBetween(const Scene& scene, std::vector<Vec3> points, const Options& options, const std::stop_token& stop);

  Kind kind() const { return kind_; }
  /// All of them are the same for all channels.
  bool grey() const { return channels_ == 1; }
  /// Extinction of the fog that is everywhere [1/unit]; 0 without one.
  Rgb fog() const { return kind_ == Kind::fog ? fog_ : Rgb(); }
  /// Media that lie far apart have tables of their own: what they let through multiplies.
  size_t parts() const { return boxes_.size(); }
  /// Of point number i and one of the parts, where there are tables.
  DepthTable table(size_t i, size_t part, int channel) const {
    const size_t of = i * parts() + part, number = of * static_cast<size_t>(channels_) + static_cast<size_t>(channel);
    return {&depth_[number * sizeOfTable()], options_.side, options_.radii, views_[of]};
  }
  /// The part around point number i; parts() where there is none.
  size_t partAround(size_t i) const;
  /// From point number i to receivers, for each channel. `seen` points to three arrays of to.count values; on return
  /// the second and the third may be the same as the first.
  void look(size_t i, const KernelReceivers& to, float* seen[3]) const;

 private:
  size_t sizeOfTable() const {
    return static_cast<size_t>(options_.side) * static_cast<size_t>(options_.side) *
           static_cast<size_t>(options_.radii);
  }
  /// Fewer than the options say where tables would take more than 256 MB.
  size_t mostParts() const;
  /// Some nodes' directions of one part from point number i, which lies in these media.
  void fill(const Scene& scene, size_t i, size_t part, const MediaState& media, size_t first);
  /// One of them by itself.
  void fillNode(const Scene& scene, size_t part, MediaRay r, const std::vector<float>& distances, float* out) const;
  /// Stretches of media within a part along a ray: visit(t0, t1) as walkMedia calls it.
  template <class Visit>
  void walkPart(const Scene& scene, size_t part, MediaRay& r, float tMax, const Visit& visit) const;

  Options options_;
  Kind kind_ = Kind::nothing;
  int channels_ = 1;  ///< that differ
  Rgb fog_;           ///< extinction of the homogeneous medium that is everywhere [1/unit]
  std::vector<Vec3> points_;
  std::vector<Bounds> boxes_;     ///< of the parts
  std::vector<float> depth_;      ///< tables of the first point, part by part, channel by channel, of the second...
  std::vector<DepthView> views_;  ///< of each point's parts
};

/// Everything outside the surfaces is in the same media: the camera's.
bool sameMediaEverywhere(const SceneView& view);

}  // namespace virga
