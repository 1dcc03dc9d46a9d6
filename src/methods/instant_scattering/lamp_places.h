// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "methods/instant_scattering/lamp_numbers.h"

namespace virga {

/// Few points for a lamp of any shape: those of an even set on it whose means are nearest to the whole lamp's. The
/// means are of where they lie, of squares of that, and of what light of them goes to each of some directions (moments
/// are matched as by Chen, Welling and Smola 2010, Super-samples from kernel herding). By the numbers of its triangles
/// alone a mesh's points could all lie on one side.
class LampPlaces {
 public:
  /// For an area light: `count` points, a power of two, in each pass. So many passes as there are sets of so many share
  /// an even set, of which each has its part: over the passes points are uniform by area.
  LampPlaces(const SceneView& scene, const EmitterView& emitter, int count, uint32_t pass);

  const std::vector<Vec2>& places() const { return places_; }
  /// Some of it faces away from any place that other parts of it face.
  bool facesApart() const { return facesApart_; }

 private:
  static constexpr int kPlaces = 128, kDirections = 24, kMoments = 9, kFeatures = kDirections + kMoments;
  using Features = std::array<float, kFeatures>;
  struct Place {
    Vec2 u;
    Features off;  ///< from the lamp's mean
  };

  /// Number n of an even set.
  static Vec2 evenPlace(int n, const FixedNumbers& numbers);
  static Features featuresOf(Vec3 p, Vec3 normal);
  /// Brings to the front `count` of them whose sum is small.
  static void balance(std::vector<Place>& places, size_t count);

  std::vector<Vec2> places_;
  bool facesApart_ = false;
};

}  // namespace virga
