// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "scene/scene.h"

namespace virga {

/// Is the density of values in a grid?
bool isGrid(const MediumView&);
/// A grid with nothing around its values?
bool endsByItself(const MediumView&);
/// The world's box around a box in the index coordinates of a medium's grid.
Bounds boundsInWorld(const MediumView&, const Bounds& inGrid);
/// Calls visit(lowest corner in index coordinates, value) for each cell whose value is greater than 0.
template <class Visit>
void visitFilledCells(const CoarseGridView& cells, const Visit& visit) {
  for (int k = 0; k < cells.nz; ++k)
    for (int j = 0; j < cells.ny; ++j)
      for (int i = 0; i < cells.nx; ++i) {
        const Vec3 cell(static_cast<float>(i), static_cast<float>(j), static_cast<float>(k));
        if (const float value = cells.cell(i, j, k); value > 0) visit(cells.origin + cell * cells.cellSize, value);
      }
}
/// Boxes that hold all of a medium: those of the shapes that it fills, cut with that of its grid's filled cells if it
/// is nothing elsewhere. Where neither ends, as far as may matter. None if the medium is nowhere.
std::vector<Bounds> placesOf(const Scene& scene, int medium);
/// A box that holds all media, likewise: nothing is missed, though there may be less in it. Empty if there are none.
Bounds boundsOfMedia(const Scene& scene);
/// Boxes without common points that hold all media, or all but `without`, `most` at most (> 0): media that are wider
/// than the gap between them share one.
std::vector<Bounds> boxesOfMedia(const Scene& scene, size_t most, int without = MediaState::kNone);

}  // namespace virga
