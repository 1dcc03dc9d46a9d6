// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <span>
#include <stop_token>
#include <vector>

#include "methods/instant_scattering/lamp_kernels.h"
#include "methods/instant_scattering/marched_light.h"
#include "methods/instant_scattering/media_between.h"

namespace virga {

/// Fixed points of the lamps, and what the media let through from them. They depend on the scene and the pass, not on
/// the camera. Every lamp has its own: up to kMostPoints together, fewer of each the more lamps there are, and only one
/// of those without an extent. Of more than kMostPoints lamps that many points are drawn by power.
class FrameLamps {
 public:
  static constexpr int kMostPoints = 64;

  /// A stop leaves tables undefined.
  FrameLamps(const Scene& scene, uint32_t pass, const std::stop_token& stop);

  FixedNumbers numbers(uint32_t pass) const { return {pass, viewOf(groups_), places_, viewOf(chosen_)}; }

  std::span<const LampPoint> points() const { return points_; }
  /// The light of any pixel can be found by packets: all lamps are points or areas.
  bool alone() const { return alone_; }

  /// A point, by its number, lights a place on each eye ray, and with what share of its intensity.
  struct Turn {
    int point;
    float share;
  };
  /// In place number n of `places`, a power of two.
  template <class Visit>
  void visitTurns(int n, int places, Visit&& visit) const {
    int first = 0;
    for (const LampGroup& group : groups_) {
      const int from = group.round ? 0 : n % group.points, to = group.round ? group.points : from + 1;
      const float share = static_cast<float>(group.points) / static_cast<float>(places * (to - from));
      for (int k = first + from; k < first + to; ++k)
        if (points_[static_cast<size_t>(k)].known) visit(Turn{k, share});
      first += group.points;
    }
  }

  /// Places on each eye ray that each group lights: in media that are marched, and in fog, by angle.
  int places() const { return places_; }
  int fogPlaces() const { return std::min(places_, kMostInFog); }

  /// Media that are bounded and homogeneous: the way to a lamp is known exactly, a stretch at a time.
  bool marches() const { return marches_; }
  /// Transmittance from point number k, where it does not march; as MediaBetween::look().
  void look(int k, const KernelReceivers& to, float* seen[3]) const { between_.look(static_cast<size_t>(k), to, seen); }

 private:
  static constexpr int kMostInFog = 4;

  void chooseGroups(const SceneView& scene);
  void choosePlaces(const SceneView& scene, uint32_t pass);

  std::vector<LampGroup> groups_;
  std::vector<Vec2> chosen_;  ///< places on lamps that are meshes or cylinders
  int places_ = FixedNumbers::kMostPlaces;
  std::vector<LampPoint> points_;  ///< of the first group, of the second...
  bool alone_ = true, marches_ = false;
  MediaBetween between_;
};

}  // namespace virga
