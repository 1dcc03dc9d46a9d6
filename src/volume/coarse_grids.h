// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "volume/grid.h"
#include "volume/nano_tree.h"

namespace virga {

/// Where the coarse cells of a grid lie, in its index coordinates. In double: indices reach 2^30.
struct CoarseLayout {
  std::array<double, 3> lo{}, hi{};  ///< the support
  int64_t cellSize = 0;              ///< [voxels], the same along each axis
  std::array<int, 3> cells{};

  size_t count() const {
    return static_cast<size_t>(cells[0]) * static_cast<size_t>(cells[1]) * static_cast<size_t>(cells[2]);
  }
};

CoarseLayout coarseLayout(const std::array<double, 3>& lo, const std::array<double, 3>& hi, const GridOptions& options);

struct CoarseGrids {
  std::vector<float> majorant, mean;  ///< x fastest
};

/// Of the clamped trilinear interpolant of a dense box: exact up to rounding; majorants are rounded up. A mean has a
/// relative error below 1e-5.
CoarseGrids coarsen(const DenseGridView& grid, const std::array<double, 3>& denseOrigin, const CoarseLayout& layout);

/// Of the trilinear interpolant of a tree, from its active nodes alone. The support must start at an integer, so that
/// no cell border lies between voxel centres. A majorant is at least the background.
CoarseGrids coarsen(const TreeContent& tree, const CoarseLayout& layout);

}  // namespace virga
