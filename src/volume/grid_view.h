// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanovdb/NanoVDB.h>

#include "core/rgb.h"
#include "core/vec.h"

namespace virga {

/// Values on a regular box of voxels. Index coordinates put voxel (i, j, k)'s *centre* at (i, j, k).
template <class T>
struct BoxView {
  const T* values = nullptr;  ///< x fastest
  int nx = 0, ny = 0, nz = 0;

  /// Trilinear; coordinates beyond the outermost centres are clamped to them.
  VIRGA_HD T lookup(Vec3 p) const {
    const float x = clamp(p.x, 0.f, static_cast<float>(nx - 1));
    const float y = clamp(p.y, 0.f, static_cast<float>(ny - 1));
    const float z = clamp(p.z, 0.f, static_cast<float>(nz - 1));
    const int i = static_cast<int>(x), j = static_cast<int>(y), k = static_cast<int>(z);
    const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j), fz = z - static_cast<float>(k);
    const int dx = i + 1 < nx ? 1 : 0, dy = j + 1 < ny ? nx : 0, dz = k + 1 < nz ? nx * ny : 0;
    const T* v = values +
                 (static_cast<size_t>(k) * static_cast<size_t>(ny) + static_cast<size_t>(j)) * static_cast<size_t>(nx) +
                 static_cast<size_t>(i);
    const T c00 = lerp(v[0], v[dx], fx), c10 = lerp(v[dy], v[dy + dx], fx);
    const T c01 = lerp(v[dz], v[dz + dx], fx), c11 = lerp(v[dz + dy], v[dz + dy + dx], fx);
    return lerp(lerp(c00, c10, fy), lerp(c01, c11, fy), fz);
  }
};

using DenseGridView = BoxView<float>;
using RgbGridView = BoxView<Rgb>;

/// Scalars on a NanoVDB tree. The grid's own index coordinates: integer points are voxel centres.
struct SparseGridView {
  const nanovdb::FloatGrid* grid = nullptr;

  /// Trilinear; what the tree does not store is its background. |p| stays below 2^31 (a Grid's support does).
  VIRGA_HD float lookup(Vec3 p) const {
    const float bx = std::floor(p.x), by = std::floor(p.y), bz = std::floor(p.z);
    const float fx = p.x - bx, fy = p.y - by, fz = p.z - bz;
    const nanovdb::Coord c(static_cast<int>(bx), static_cast<int>(by), static_cast<int>(bz));
    auto accessor = grid->getAccessor();
    if (((c.x() + 1) & 7) != 0 && ((c.y() + 1) & 7) != 0 && ((c.z() + 1) & 7) != 0) {
      // The stencil lies within one block of 8^3: a leaf, or a part of a tile, which is constant.
      const auto* leaf = accessor.probeLeaf(c);
      return leaf ? lookup(leaf->data()->mValues, c, fx, fy, fz) : accessor.getValue(c);
    }
    const auto at = [&](int dx, int dy, int dz) { return accessor.getValue(c.offsetBy(dx, dy, dz)); };
    const float c00 = lerp(at(0, 0, 0), at(1, 0, 0), fx), c10 = lerp(at(0, 1, 0), at(1, 1, 0), fx);
    const float c11 = lerp(at(0, 1, 1), at(1, 1, 1), fx), c01 = lerp(at(0, 0, 1), at(1, 0, 1), fx);
    return lerp(lerp(c00, c10, fy), lerp(c01, c11, fy), fz);
  }

 private:
  /// The stencil at `c` within the values of a leaf (z fastest).
  VIRGA_HD static float lookup(const float* values, nanovdb::Coord c, float fx, float fy, float fz) {
    const float* v = values + ((c.x() & 7) * 64 + (c.y() & 7) * 8 + (c.z() & 7));
    const float c00 = lerp(v[0], v[64], fx), c10 = lerp(v[8], v[72], fx);
    const float c01 = lerp(v[1], v[65], fx), c11 = lerp(v[9], v[73], fx);
    return lerp(lerp(c00, c10, fy), lerp(c01, c11, fy), fz);
  }
};

/// A box of coarse cells over a fine grid's support, each with one number: the maximum (majorants) or the mean of what
/// the trilinear interpolant takes in the part of the cell that lies in the support. The first cell starts where the
/// support does; the last ones may reach beyond it.
struct CoarseGridView {
  const float* values = nullptr;  ///< x fastest
  int nx = 0, ny = 0, nz = 0;
  Vec3 origin;    ///< lowest corner, in index coordinates of the fine grid
  Vec3 cellSize;  ///< edge lengths, in index coordinates of the fine grid

  VIRGA_HD float cell(int i, int j, int k) const {
    return values[(static_cast<size_t>(k) * static_cast<size_t>(ny) + static_cast<size_t>(j)) *
                      static_cast<size_t>(nx) +
                  static_cast<size_t>(i)];
  }
  /// Of the cell that holds p, or is nearest to it.
  VIRGA_HD float cellAt(Vec3 p) const {
    const auto index = [](float x, int n) { return static_cast<int>(clamp(x, 0, static_cast<float>(n - 1))); };
    return cell(index((p.x - origin.x) / cellSize.x, nx), index((p.y - origin.y) / cellSize.y, ny),
                index((p.z - origin.z) / cellSize.z, nz));
  }
};

/// A scalar field: trilinear inside its support, `background` outside it.
struct GridView {
  enum class Kind : uint8_t { constant, dense, sparse };

  Kind kind = Kind::constant;
  DenseGridView dense;
  SparseGridView sparse;
  Vec3 denseOrigin;           ///< index coordinates of the dense box's voxel (0, 0, 0)
  Vec3 supportLo, supportHi;  ///< index coordinates; a `.vol` ends at its box, a VDB one voxel beyond its active voxels
  float background = 0;       ///< also the value of Kind::constant, everywhere
  CoarseGridView majorant;    ///< covers the support; absent for Kind::constant
  CoarseGridView mean;        ///< likewise

  VIRGA_HD bool supports(Vec3 p) const {
    return p.x >= supportLo.x && p.y >= supportLo.y && p.z >= supportLo.z && p.x <= supportHi.x && p.y <= supportHi.y &&
           p.z <= supportHi.z;
  }
  /// Value at index coordinates p.
  VIRGA_HD float lookup(Vec3 p) const {
    if (kind == Kind::constant || !supports(p)) return background;
    return lookupInside(p);
  }
  /// Mean over the coarse cell that p lies in.
  VIRGA_HD float localMean(Vec3 p) const {
    return kind == Kind::constant || !supports(p) ? background : mean.cellAt(p);
  }
  /// Value at index coordinates p inside the support of a dense or sparse grid.
  VIRGA_HD float lookupInside(Vec3 p) const {
    return kind == Kind::dense ? dense.lookup(p - denseOrigin) : sparse.lookup(p);
  }
};

}  // namespace virga
