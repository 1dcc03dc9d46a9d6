// SPDX-License-Identifier: Apache-2.0
#include "volume/coarse_grids.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/parallel.h"

namespace virga {
namespace {

// Lookups in single precision may exceed the exact interpolant by a few units in the last place.
constexpr float kRoundUp = 1 + 2e-6f;

int64_t powerOfTwoAbove(double x) {
  int64_t power = 1;
  while (static_cast<double>(power) < x) power *= 2;
  return power;
}

int64_t cellSizeFor(double extent, const GridOptions& options) {
  int64_t size = options.cellSize;
  if (size <= 0) {
    size = std::clamp<int64_t>(powerOfTwoAbove(extent / 16), 2, 8);
    size = std::max(size, powerOfTwoAbove(extent / 32));
  }
  while (std::ceil(extent / static_cast<double>(size)) > std::max(1, options.maxCells)) size *= 2;
  return size;
}

// ---- Dense ----

// A place between voxels i and i + 1 of one axis (at i where fraction is 0).
struct Sample {
  int voxel;
  float fraction;
};

// What one coarse cell sees of one axis. The maximum of a multilinear function over a box is at a corner of one of its
// linear pieces: at a voxel centre or at the cell's border. So the product of the axes' samples holds the maximum.
struct AxisCell {
  int first = 0;                // voxels with a weight
  std::vector<float> weights;   // integral of each voxel's hat function over the cell, divided by the cell's length
  int lo = 0, hi = -1;          // voxel centres within the closed cell
  std::vector<Sample> borders;  // borders of the cell that are no voxel centres
};

// Integral of the hat function max(0, 1 - |t|) from -infinity to x.
double hatIntegral(double x) {
  if (x <= 0) return 0.5 * std::pow(std::max(0.0, 1 + x), 2);
  return 1 - 0.5 * std::pow(std::max(0.0, 1 - x), 2);
}

// The integral of voxel i's share of the clamped interpolant over [a, b]; the outermost voxels go on for ever.
double share(int i, int n, double a, double b) {
  const double last = n - 1;
  const double ca = std::clamp(a, 0.0, last), cb = std::clamp(b, 0.0, last);
  double sum = hatIntegral(cb - i) - hatIntegral(ca - i);
  if (i == 0) sum += std::max(0.0, std::min(b, 0.0) - a);
  if (i == n - 1) sum += std::max(0.0, b - std::max(a, last));
  return sum;
}

AxisCell axisCell(int n, double a, double b) {
  AxisCell cell;
  const double last = n - 1;
  const double ca = std::clamp(a, 0.0, last), cb = std::clamp(b, 0.0, last);
  cell.first = static_cast<int>(std::floor(ca));
  for (int i = cell.first; i <= static_cast<int>(std::ceil(cb)); ++i)
    cell.weights.push_back(static_cast<float>(share(i, n, a, b) / (b - a)));
  cell.lo = static_cast<int>(std::ceil(ca));
  cell.hi = static_cast<int>(std::floor(cb));
  for (double border : {ca, cb})
    if (border != std::floor(border))
      cell.borders.push_back({static_cast<int>(border), static_cast<float>(border - std::floor(border))});
  return cell;
}

std::vector<AxisCell> axisCells(int n, int axis, double denseOrigin, const CoarseLayout& layout) {
  const auto a = static_cast<size_t>(axis);
  const auto size = static_cast<double>(layout.cellSize);
  std::vector<AxisCell> cells;
  for (int k = 0; k < layout.cells[a]; ++k) {
    const double lo = layout.lo[a] + k * size, hi = std::min(lo + size, layout.hi[a]);
    cells.push_back(axisCell(n, lo - denseOrigin, hi - denseOrigin));
  }
  return cells;
}

std::vector<Sample> samplesOf(const AxisCell& cell) {
  std::vector<Sample> samples = cell.borders;
  for (int i = cell.lo; i <= cell.hi; ++i) samples.push_back({i, 0});
  return samples;
}

// One line of coarse cells along x.
class DenseLine {
 public:
  DenseLine(const DenseGridView& grid, const std::vector<AxisCell>& cells)
      : grid_(grid), cells_(cells), row_(static_cast<size_t>(grid.nx)), blended_(row_.size()) {}

  void maxima(const AxisCell& y, const AxisCell& z, float* out) {
    std::fill(row_.begin(), row_.end(), 0.f);
    std::fill(out, out + cells_.size(), 0.f);
    for (const Sample& k : samplesOf(z))
      for (const Sample& j : samplesOf(y)) addMaxima(sampledRow(j, k), out);
    for (size_t i = 0; i < cells_.size(); ++i) {
      float m = out[i];
      for (int x = cells_[i].lo; x <= cells_[i].hi; ++x) m = std::max(m, row_[static_cast<size_t>(x)]);
      out[i] = m * kRoundUp;
    }
  }

  void means(const AxisCell& y, const AxisCell& z, float* out) {
    std::fill(row_.begin(), row_.end(), 0.f);
    for (size_t k = 0; k < z.weights.size(); ++k)
      for (size_t j = 0; j < y.weights.size(); ++j)
        addWeighted(row(y.first + static_cast<int>(j), z.first + static_cast<int>(k)), y.weights[j] * z.weights[k]);
    for (size_t i = 0; i < cells_.size(); ++i) {
      double sum = 0;
      for (size_t x = 0; x < cells_[i].weights.size(); ++x)
        sum += cells_[i].weights[x] * row_[static_cast<size_t>(cells_[i].first) + x];
      out[i] = static_cast<float>(sum);
    }
  }

 private:
  const float* row(int j, int k) const {
    return grid_.values +
           (static_cast<size_t>(k) * static_cast<size_t>(grid_.ny) + static_cast<size_t>(j)) * row_.size();
  }

  const float* sampledRow(const Sample& j, const Sample& k) {
    if (j.fraction == 0 && k.fraction == 0) return row(j.voxel, k.voxel);
    const int dj = j.fraction > 0 ? 1 : 0, dk = k.fraction > 0 ? 1 : 0;
    const float* v00 = row(j.voxel, k.voxel);
    const float* v10 = row(j.voxel + dj, k.voxel);
    const float* v01 = row(j.voxel, k.voxel + dk);
    const float* v11 = row(j.voxel + dj, k.voxel + dk);
    float* out = blended_.data();
#pragma omp simd
    for (size_t x = 0; x < row_.size(); ++x)
      out[x] = lerp(lerp(v00[x], v10[x], j.fraction), lerp(v01[x], v11[x], j.fraction), k.fraction);
    return out;
  }

  void addMaxima(const float* values, float* out) {
    float* best = row_.data();
#pragma omp simd
    for (size_t x = 0; x < row_.size(); ++x) best[x] = values[x] > best[x] ? values[x] : best[x];
    for (size_t i = 0; i < cells_.size(); ++i)
      for (const Sample& s : cells_[i].borders)
        out[i] = std::max(out[i], lerp(values[s.voxel], values[s.voxel + 1], s.fraction));
  }

  void addWeighted(const float* values, float weight) {
    float* sum = row_.data();
#pragma omp simd
    for (size_t x = 0; x < row_.size(); ++x) sum[x] += weight * values[x];
  }

  const DenseGridView& grid_;
  const std::vector<AxisCell>& cells_;
  std::vector<float> row_, blended_;
};

// ---- Sparse ----

// The voxels lo..hi (inclusive) of one axis as they meet the coarse cells; a voxel on a border belongs to both sides.
struct AxisSpan {
  int firstCell = 0, lastCell = -1;
};

class SparseAxis {
 public:
  SparseAxis(const CoarseLayout& layout, size_t axis)
      : lo_(static_cast<int64_t>(layout.lo[axis])),
        hi_(static_cast<int64_t>(layout.hi[axis])),
        size_(layout.cellSize),
        cells_(layout.cells[axis]) {}

  AxisSpan span(int64_t lo, int64_t hi) const {
    const int64_t first =
        (lo - lo_ - 1) / size_;  // lo is above lo_: the support begins one voxel before the active ones
    return {static_cast<int>(first), static_cast<int>(std::min<int64_t>((hi - lo_) / size_, cells_ - 1))};
  }
  int64_t cellLo(int cell) const { return lo_ + cell * size_; }
  int64_t cellHi(int cell) const { return std::min(lo_ + (cell + 1) * size_, hi_); }
  double cellLength(int cell) const { return static_cast<double>(cellHi(cell) - cellLo(cell)); }

  // The integral over a cell of the hat functions of voxels lo..hi: one each, a half on the borders.
  double weight(int cell, int64_t lo, int64_t hi) const {
    const int64_t a = cellLo(cell), b = cellHi(cell);
    const int64_t from = std::max(lo, a), to = std::min(hi, b);
    if (from > to) return 0;
    return static_cast<double>(to - from + 1) - (from == a ? 0.5 : 0.0) - (to == b ? 0.5 : 0.0);
  }

 private:
  int64_t lo_, hi_, size_;
  int cells_;
};

// A box of voxels that a node stores.
struct VoxelBox {
  std::array<int64_t, 3> lo, hi;  // inclusive
};

VoxelBox boxOf(nanovdb::Coord origin, int dim) {
  return {{origin.x(), origin.y(), origin.z()},
          {int64_t{origin.x()} + dim - 1, int64_t{origin.y()} + dim - 1, int64_t{origin.z()} + dim - 1}};
}

class SparseCoarse {
 public:
  explicit SparseCoarse(const CoarseLayout& layout)
      : layout_(layout), axes_{SparseAxis(layout, 0), SparseAxis(layout, 1), SparseAxis(layout, 2)} {}

  std::vector<float> majorants(const TreeContent& tree) const {
    std::vector<std::atomic<float>> best(layout_.count());
    for (auto& b : best) b.store(tree.background, std::memory_order_relaxed);
    parallelFor(static_cast<int64_t>(tree.leaves.size()), 16, [&](int64_t n) {
      const TreeLeaf& leaf = tree.leaves[static_cast<size_t>(n)];
      forCells(boxOf(leaf.origin, 8), [&](size_t cell, const VoxelBox& part, const std::array<int, 3>&) {
        raise(best[cell], maximumOf(leaf, part));
      });
    });
    for (const TreeTile& tile : tree.tiles)
      forCells(boxOf(tile.origin, tile.dim),
               [&](size_t cell, const VoxelBox&, const std::array<int, 3>&) { raise(best[cell], tile.value); });
    std::vector<float> out(best.size());
    for (size_t i = 0; i < out.size(); ++i) out[i] = best[i].load(std::memory_order_relaxed) * kRoundUp;
    return out;
  }

  // Leaves are summed in a fixed number of portions, added in order: the same sums for every number of threads.
  std::vector<float> means(const TreeContent& tree) const {
    const size_t leaves = tree.leaves.size(), portions = std::clamp<size_t>(leaves / 256, 1, 8);
    std::vector<std::vector<double>> sums(portions, std::vector<double>(layout_.count()));
    parallelFor(static_cast<int64_t>(portions), 1, [&](int64_t p) {
      const auto portion = static_cast<size_t>(p);
      for (size_t n = portion * leaves / portions; n < (portion + 1) * leaves / portions; ++n)
        addLeaf(tree.leaves[n], tree.background, sums[portion]);
    });
    for (size_t p = 1; p < portions; ++p)
      for (size_t i = 0; i < sums[p].size(); ++i) sums[0][i] += sums[p][i];
    for (const TreeTile& tile : tree.tiles) addTile(tile, tree.background, sums[0]);
    return normalised(sums[0], tree.background);
  }

 private:
  static void raise(std::atomic<float>& best, float value) {
    float seen = best.load(std::memory_order_relaxed);
    while (seen < value && !best.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
    }
  }

  // Calls body(cell, the voxels of the box within the closed cell, the cell's coordinates).
  template <class Body>
  void forCells(const VoxelBox& whole, const Body& body) const {
    VoxelBox box = whole;
    std::array<AxisSpan, 3> span;
    for (size_t a = 0; a < 3; ++a) {
      // Voxels outside the active box are background: they add nothing and may lie beyond the support.
      box.lo[a] = std::max(box.lo[a], static_cast<int64_t>(layout_.lo[a]) + 1);
      box.hi[a] = std::min(box.hi[a], static_cast<int64_t>(layout_.hi[a]) - 1);
      if (box.lo[a] > box.hi[a]) return;
      span[a] = axes_[a].span(box.lo[a], box.hi[a]);
    }
    for (int k = span[2].firstCell; k <= span[2].lastCell; ++k)
      for (int j = span[1].firstCell; j <= span[1].lastCell; ++j)
        for (int i = span[0].firstCell; i <= span[0].lastCell; ++i)
          body(index(i, j, k), clipped(box, {i, j, k}), std::array<int, 3>{i, j, k});
  }

  VoxelBox clipped(VoxelBox box, const std::array<int, 3>& cell) const {
    for (size_t a = 0; a < 3; ++a) {
      box.lo[a] = std::max(box.lo[a], axes_[a].cellLo(cell[a]));
      box.hi[a] = std::min(box.hi[a], axes_[a].cellHi(cell[a]));
    }
    return box;
  }

  size_t index(int i, int j, int k) const {
    return (static_cast<size_t>(k) * static_cast<size_t>(layout_.cells[1]) + static_cast<size_t>(j)) *
               static_cast<size_t>(layout_.cells[0]) +
           static_cast<size_t>(i);
  }

  template <class Body>
  static void forVoxels(const TreeLeaf& leaf, const VoxelBox& box, const Body& body) {
    const float* values = leaf.node->data()->mValues;
    for (int64_t x = box.lo[0]; x <= box.hi[0]; ++x)
      for (int64_t y = box.lo[1]; y <= box.hi[1]; ++y)
        for (int64_t z = box.lo[2]; z <= box.hi[2]; ++z)
          body(x, y, z, values[((x & 7) << 6) | ((y & 7) << 3) | (z & 7)]);
  }

  static float maximumOf(const TreeLeaf& leaf, const VoxelBox& box) {
    float best = 0;
    forVoxels(leaf, box, [&](int64_t, int64_t, int64_t, float value) { best = std::max(best, value); });
    return best;
  }

  void addLeaf(const TreeLeaf& leaf, float background, std::vector<double>& sums) const {
    forCells(boxOf(leaf.origin, 8), [&](size_t cell, const VoxelBox& part, const std::array<int, 3>& c) {
      double sum = 0;
      forVoxels(leaf, part, [&](int64_t x, int64_t y, int64_t z, float value) {
        sum += static_cast<double>(value - background) * axes_[0].weight(c[0], x, x) * axes_[1].weight(c[1], y, y) *
               axes_[2].weight(c[2], z, z);
      });
      sums[cell] += sum;
    });
  }

  void addTile(const TreeTile& tile, float background, std::vector<double>& sums) const {
    forCells(boxOf(tile.origin, tile.dim), [&](size_t cell, const VoxelBox& part, const std::array<int, 3>& c) {
      double weight = static_cast<double>(tile.value - background);
      for (size_t a = 0; a < 3; ++a) weight *= axes_[a].weight(c[a], part.lo[a], part.hi[a]);
      sums[cell] += weight;
    });
  }

  std::vector<float> normalised(const std::vector<double>& sums, float background) const {
    std::vector<float> out(sums.size());
    for (int k = 0; k < layout_.cells[2]; ++k)
      for (int j = 0; j < layout_.cells[1]; ++j)
        for (int i = 0; i < layout_.cells[0]; ++i) {
          const double volume = axes_[0].cellLength(i) * axes_[1].cellLength(j) * axes_[2].cellLength(k);
          out[index(i, j, k)] = std::max(0.f, static_cast<float>(background + sums[index(i, j, k)] / volume));
        }
    return out;
  }

  const CoarseLayout& layout_;
  std::array<SparseAxis, 3> axes_;
};

}  // namespace

CoarseLayout coarseLayout(const std::array<double, 3>& lo, const std::array<double, 3>& hi,
                          const GridOptions& options) {
  CoarseLayout layout{lo, hi, 0, {}};
  double extent = 0;
  for (size_t a = 0; a < 3; ++a) extent = std::max(extent, hi[a] - lo[a]);
  layout.cellSize = cellSizeFor(extent, options);
  for (size_t a = 0; a < 3; ++a)
    layout.cells[a] = std::max(1, static_cast<int>(std::ceil((hi[a] - lo[a]) / static_cast<double>(layout.cellSize))));
  return layout;
}

CoarseGrids coarsen(const DenseGridView& grid, const std::array<double, 3>& denseOrigin, const CoarseLayout& layout) {
  const std::vector<AxisCell> x = axisCells(grid.nx, 0, denseOrigin[0], layout);
  const std::vector<AxisCell> y = axisCells(grid.ny, 1, denseOrigin[1], layout);
  const std::vector<AxisCell> z = axisCells(grid.nz, 2, denseOrigin[2], layout);
  CoarseGrids out{std::vector<float>(layout.count()), std::vector<float>(layout.count())};
  parallelFor(static_cast<int64_t>(y.size() * z.size()), 4, [&](int64_t line) {
    const auto n = static_cast<size_t>(line);
    DenseLine worker(grid, x);
    worker.maxima(y[n % y.size()], z[n / y.size()], out.majorant.data() + n * x.size());
    worker.means(y[n % y.size()], z[n / y.size()], out.mean.data() + n * x.size());
  });
  return out;
}

CoarseGrids coarsen(const TreeContent& tree, const CoarseLayout& layout) {
  const SparseCoarse coarse(layout);
  return {coarse.majorants(tree), coarse.means(tree)};
}

}  // namespace virga
