// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene_view.h"

namespace virga {

/// A little disk that stands for a piece of a surface.
struct SurfaceDisk {
  Vec3 p, normal;    ///< world; unit, toward either side
  float radius = 0;  ///< [unit]
};

/// The surfaces of a scene as disks, made once, of which everyone takes a subset of their own. Each shape is divided in
/// cells of equal area, and in each cell there are kChoices disks, one as good as another: whoever picks one of each
/// cell has an area-stratified sampling of all surfaces. Null boundaries are no surfaces.
class SurfacePoints {
 public:
  static constexpr uint32_t kChoices = 8;
  /// So many of the disks of a subset cover a point, on average.
  static constexpr float kOverlap = 2;

  SurfacePoints() = default;
  /// About `cells` cells, half of them shared out by area, half the same for each shape, so that a small one on a wide
  /// ground is not lost; one for each shape at least. `seed` says where the disks are.
  SurfacePoints(const SceneView& scene, int cells, uint64_t seed);

  int cells() const { return static_cast<int>(disks_.size() / kChoices); }
  const SurfaceDisk& disk(int cell, uint32_t choice) const {
    return disks_[static_cast<size_t>(cell) * kChoices + choice % kChoices];
  }

 private:
  void addShape(const ShapeView& shape, int cells, uint64_t seed);

  std::vector<SurfaceDisk> disks_;
};

}  // namespace virga
