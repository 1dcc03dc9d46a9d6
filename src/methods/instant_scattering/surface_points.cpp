// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/surface_points.h"

#include "core/random.h"

namespace virga {
namespace {

/// Columns of the unit square whose cells are about square on the shape: a mesh's triangles lie side by side in it.
int columnsFor(const ShapeView& shape, int cells) {
  const int pieces = std::max(1, shape.triangleChoice.count);
  const double columns = std::sqrt(static_cast<double>(cells) * pieces);
  return std::clamp(static_cast<int>(std::lround(columns)), 1, cells);
}

}  // namespace

SurfacePoints::SurfacePoints(const SceneView& scene, int cells, uint64_t seed) {
  double area = 0;
  for (const ShapeView& shape : scene.surfaces) area += double{shape.area};
  if (!(area > 0)) return;
  for (int i = 0; i < scene.surfaces.size; ++i) {
    const double share = 0.5 * (double{scene.surfaces[i].area} / area + 1.0 / scene.surfaces.size);
    const int own = std::max(1, static_cast<int>(std::lround(share * cells)));
    addShape(scene.surfaces[i], own, hash64(seed + static_cast<uint64_t>(i)));
  }
}

void SurfacePoints::addShape(const ShapeView& shape, int cells, uint64_t seed) {
  const int columns = columnsFor(shape, cells), rows = (cells + columns - 1) / columns;
  const float radius = std::sqrt(kOverlap * kInvPi * shape.area / static_cast<float>(columns * rows));
  Pcg32 random(seed);
  for (int x = 0; x < columns; ++x)
    for (int y = 0; y < rows; ++y)
      for (uint32_t i = 0; i < kChoices; ++i) {
        const float u = (static_cast<float>(x) + random.next()) / static_cast<float>(columns);
        const float v = (static_cast<float>(y) + random.next()) / static_cast<float>(rows);
        const ShapePoint s = uniformPointOnShape(shape, {std::min(u, 0x1.fffffep-1f), v});
        disks_.push_back({s.p, s.normal, radius});
      }
}

}  // namespace virga
