// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "core/transform.h"

namespace virga {

/// A box of voxels on its way to or from a file: nx * ny * nz values, x fastest, voxel (i, j, k)'s centre at index (i,
/// j, k).
struct DenseVolume {
  int nx = 0, ny = 0, nz = 0;
  std::vector<float> values;
  Matrix4 indexToWorld;
  std::string name = "density";
};

}  // namespace virga
