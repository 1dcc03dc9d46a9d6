// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "volume/grid.h"
#include "volume/nano_tree.h"

namespace virga {

/// How loaders make grids. All throw Error on values that no grid may have.
struct GridFactory {
  static std::shared_ptr<const Grid> constant(float value);
  static std::shared_ptr<const Grid> box(int nx, int ny, int nz, std::vector<float> values, const GridOptions& options);
  /// `bytes` starts with a valid NanoVDB float grid; dense or sparse as the options say.
  static std::shared_ptr<const Grid> tree(AlignedBytes bytes, const GridOptions& options);

 private:
  static std::shared_ptr<Grid> empty();
  static void fillDense(Grid& grid, const TreeContent& content);
  static void keepTree(Grid& grid, AlignedBytes bytes);
};

}  // namespace virga
