// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/transform.h"
#include "volume/grid_view.h"

namespace virga {

/// How a Grid is stored and how fine its majorant and mean grids are.
struct GridOptions {
  enum class Storage { automatic, dense, sparse };

  int cellSize = 0;   ///< edge of a coarse cell in voxels; 0: 16 to 32 cells along the longest axis, 8 voxels at 128^3
  int maxCells = 64;  ///< per axis; a cellSize that would give more is raised
  Storage storage = Storage::automatic;  ///< of a VDB: dense where that costs at most the bytes below
  size_t denseBelow = size_t{8} << 20;   ///< bytes of a dense box that are always affordable
  double denseRatio = 2;                 ///< bytes of a dense box, relative to the tree's
};

/// An immutable scalar field with its majorant and mean grids. All values are finite and >= 0 (checked when it is
/// made).
class Grid {
 public:
  /// Opaque storage; alive as long as the Grid.
  struct Storage;

  static std::shared_ptr<const Grid> constant(float value);

  /// A box of nx * ny * nz values (x fastest) with voxel centres at (i + 0.5) / n of the unit cube, clamped at the
  /// border and 0 outside the cube: the conventions of `.vol` files. Throws Error on NaN or negative values (where the
  /// first is, how many).
  static std::shared_ptr<const Grid> dense(int nx, int ny, int nz, std::vector<float> values,
                                           const GridOptions& options = {});

  const GridView& view() const { return view_; }
  /// Index coordinates to the grid's own world: a VDB's transform; for constant and dense grids, the unit cube.
  const Matrix4& indexToWorld() const { return indexToWorld_; }
  float maximum() const { return maximum_; }
  size_t bytes() const;  ///< resident: values, tree, majorant and mean

  ~Grid();

 private:
  friend struct GridFactory;
  Grid();
  GridView view_;
  Matrix4 indexToWorld_;
  float maximum_ = 0;
  std::unique_ptr<Storage> storage_;
};

/// RGB on the unit cube (albedo), as Grid::dense. Values in [0, inf), finite.
class RgbGrid {
 public:
  RgbGrid(int nx, int ny, int nz, std::vector<Rgb> values);
  static RgbGrid grey(int nx, int ny, int nz, const std::vector<float>& values);
  RgbGridView view() const { return {values_.data(), nx_, ny_, nz_}; }
  float maximum() const;  ///< over voxels and channels
  /// The largest channel of each voxel: its interpolant bounds those of the channels.
  std::shared_ptr<const Grid> largestChannel() const;

 private:
  int nx_, ny_, nz_;
  std::vector<Rgb> values_;
};

}  // namespace virga
