// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "volume/grid_view.h"

namespace virga {

/// out[n]: the value of a dense grid of fewer than 2^31 voxels at o + n d, index coordinates. All of these lie in its
/// support, but for rounding. A plain loop of which compilers make vector code.
VIRGA_HD inline void lookupAlong(const GridView& grid, Vec3 o, Vec3 d, int count, float* out) {
  const DenseGridView& box = grid.dense;
  const float* values = box.values;
  const Vec3 start = o - grid.denseOrigin;
  const float mostX = static_cast<float>(box.nx - 1), mostY = static_cast<float>(box.ny - 1),
              mostZ = static_cast<float>(box.nz - 1);
  const int row = box.nx, slice = box.nx * box.ny, lastX = box.nx - 1, lastY = box.ny - 1, lastZ = box.nz - 1;
#pragma omp simd
  for (int n = 0; n < count; ++n) {
    const auto t = static_cast<float>(n);
    const float px = start.x + t * d.x, py = start.y + t * d.y, pz = start.z + t * d.z;
    const float ax = px > 0 ? px : 0, ay = py > 0 ? py : 0, az = pz > 0 ? pz : 0;
    const float x = ax < mostX ? ax : mostX, y = ay < mostY ? ay : mostY, z = az < mostZ ? az : mostZ;
    const int i = static_cast<int>(x), j = static_cast<int>(y), k = static_cast<int>(z);
    const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j), fz = z - static_cast<float>(k);
    const int dx = i < lastX ? 1 : 0, dy = j < lastY ? row : 0, dz = k < lastZ ? slice : 0;
    const int v = k * slice + j * row + i;
    const float c00 = values[v] + (values[v + dx] - values[v]) * fx;
    const float c10 = values[v + dy] + (values[v + dy + dx] - values[v + dy]) * fx;
    const float c01 = values[v + dz] + (values[v + dz + dx] - values[v + dz]) * fx;
    const float c11 = values[v + dz + dy] + (values[v + dz + dy + dx] - values[v + dz + dy]) * fx;
    const float c0 = c00 + (c10 - c00) * fy, c1 = c01 + (c11 - c01) * fy;
    out[n] = c0 + (c1 - c0) * fz;
  }
}

}  // namespace virga
