// SPDX-License-Identifier: Apache-2.0
#include "volume/grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"
#include "volume/coarse_grids.h"
#include "volume/grid_factory.h"
#include "volume/value_check.h"

namespace virga {

struct Grid::Storage {
  std::vector<float> dense;
  AlignedBytes tree;
  CoarseGrids coarse;
};

namespace {

size_t product(int nx, int ny, int nz) {
  return static_cast<size_t>(nx) * static_cast<size_t>(ny) * static_cast<size_t>(nz);
}

Vec3 toVec3(const std::array<double, 3>& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

// The greatest of n values if all are good, -1 otherwise. As integers, good floats are ordered and all others lie above
// them
// (-0 too, which the slow path lets pass), so the loop has no comparison that NaN could fool.
float maximumIfGood(const float* values, int64_t n) {
  uint32_t best = 0;
#pragma omp simd reduction(max : best)
  for (int64_t i = 0; i < n; ++i) best = std::max(best, std::bit_cast<uint32_t>(values[i]));
  return best <= std::bit_cast<uint32_t>(std::numeric_limits<float>::max()) ? std::bit_cast<float>(best) : -1;
}

// Checks `channels` floats per voxel, x fastest.
ValueCheck checkBox(int nx, int ny, int nz, int channels, const float* values) {
  const int64_t row = int64_t{nx} * channels;
  std::vector<ValueCheck> slices(static_cast<size_t>(nz));
  parallelFor(nz, 1, [&](int64_t k) {
    ValueCheck& check = slices[static_cast<size_t>(k)];
    const float* slice = values + k * ny * row;
    check.maximum = maximumIfGood(slice, ny * row);
    if (check.maximum >= 0) return;
    check.maximum = 0;
    for (int64_t i = 0; i < ny * row; ++i) check.add(slice[i], {i % row / channels, i / row, k});
  });
  ValueCheck total;
  for (const ValueCheck& check : slices) total = combined(total, check);
  return total;
}

void requireBox(int nx, int ny, int nz, size_t values) {
  if (nx < 1 || ny < 1 || nz < 1) throw Error(fmt::format("grid of {} x {} x {} voxels has none", nx, ny, nz));
  if (int64_t{nx} * ny > std::numeric_limits<int>::max())
    throw Error(fmt::format("grid of {} x {} x {} voxels has slices of more than 2^31", nx, ny, nz));
  if (product(nx, ny, nz) != values)
    throw Error(fmt::format("grid of {} x {} x {} voxels has {} values", nx, ny, nz, values));
}

Matrix4 unitCubeMap(int nx, int ny, int nz) {
  const double x = 1.0 / nx, y = 1.0 / ny, z = 1.0 / nz;
  return Matrix4::translation(0.5 * x, 0.5 * y, 0.5 * z) * Matrix4::scaling(x, y, z);
}

CoarseGridView viewOf(const std::vector<float>& values, const CoarseLayout& layout) {
  return {values.data(),   layout.cells[0],   layout.cells[1],
          layout.cells[2], toVec3(layout.lo), Vec3(static_cast<float>(layout.cellSize))};
}

void setCoarse(GridView& view, const CoarseGrids& coarse, const CoarseLayout& layout) {
  view.majorant = viewOf(coarse.majorant, layout);
  view.mean = viewOf(coarse.mean, layout);
}

Matrix4 mapOf(const nanovdb::Map& map) {
  Matrix4 m;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) m(row, column) = map.mMatD[3 * row + column];
    m(row, 3) = map.mVecD[row];
  }
  if (!m.isFinite() || m.isSingular()) throw Error("grid has a transform that cannot be inverted");
  return m;
}

// Support of a tree: what is not background reaches one voxel beyond the active ones.
struct Support {
  std::array<double, 3> lo, hi;

  explicit Support(const TreeContent& c)
      : lo{c.lo.x() - 1.0, c.lo.y() - 1.0, c.lo.z() - 1.0}, hi{c.hi.x() + 1.0, c.hi.y() + 1.0, c.hi.z() + 1.0} {}
  double voxels(size_t axis) const { return hi[axis] - lo[axis] + 1; }
};

bool denseIsAffordable(const Support& support, size_t treeBytes, const GridOptions& options) {
  const double slice = support.voxels(0) * support.voxels(1), bytes = slice * support.voxels(2) * sizeof(float);
  if (slice > std::numeric_limits<int>::max()) return false;  // a DenseGridView counts in int
  if (options.storage != GridOptions::Storage::automatic) return options.storage == GridOptions::Storage::dense;
  return bytes <= static_cast<double>(options.denseBelow) ||
         bytes <= options.denseRatio * static_cast<double>(treeBytes);
}

// Writes the nodes of a tree into a dense box.
class DenseFiller {
 public:
  DenseFiller(std::vector<float>& values, const Support& support, const std::array<int64_t, 3>& n)
      : values_(values), n_(n) {
    for (size_t a = 0; a < 3; ++a) origin_[a] = static_cast<int64_t>(support.lo[a]);
  }

  void add(const TreeLeaf& leaf) {
    const float* v = leaf.node->data()->mValues;
    fill(leaf.origin, 8, [&](int64_t x, int64_t y, int64_t z) { return v[((x & 7) << 6) | ((y & 7) << 3) | (z & 7)]; });
  }
  void add(const TreeTile& tile) {
    fill(tile.origin, tile.dim, [&](int64_t, int64_t, int64_t) { return tile.value; });
  }

 private:
  template <class Value>
  void fill(nanovdb::Coord at, int dim, const Value& value) {
    std::array<int64_t, 3> lo{at.x(), at.y(), at.z()}, hi{};
    for (size_t a = 0; a < 3; ++a) {
      hi[a] = std::min(lo[a] + dim, origin_[a] + n_[a]);
      lo[a] = std::max(lo[a], origin_[a]);
    }
    for (int64_t z = lo[2]; z < hi[2]; ++z)
      for (int64_t y = lo[1]; y < hi[1]; ++y) {
        float* row = values_.data() + ((z - origin_[2]) * n_[1] + (y - origin_[1])) * n_[0] - origin_[0];
        for (int64_t x = lo[0]; x < hi[0]; ++x) row[x] = value(x, y, z);
      }
  }

  std::vector<float>& values_;
  std::array<int64_t, 3> n_, origin_{};
};

}  // namespace

Grid::Grid() : storage_(std::make_unique<Storage>()) {}
Grid::~Grid() = default;

std::shared_ptr<const Grid> Grid::constant(float value) { return GridFactory::constant(value); }

std::shared_ptr<const Grid> Grid::dense(int nx, int ny, int nz, std::vector<float> values, const GridOptions& options) {
  return GridFactory::box(nx, ny, nz, std::move(values), options);
}

size_t Grid::bytes() const {
  const size_t floats = storage_->dense.size() + storage_->coarse.majorant.size() + storage_->coarse.mean.size();
  return floats * sizeof(float) + storage_->tree.size();
}

std::shared_ptr<Grid> GridFactory::empty() { return std::shared_ptr<Grid>(new Grid); }

std::shared_ptr<const Grid> GridFactory::constant(float value) {
  ValueCheck check;
  check.add(value, {});
  if (!check.good()) throw Error(fmt::format("value {} of a grid is not finite or negative", value));
  auto grid = empty();
  grid->view_.background = grid->maximum_ = value;
  return grid;
}

std::shared_ptr<const Grid> GridFactory::box(int nx, int ny, int nz, std::vector<float> values,
                                             const GridOptions& options) {
  requireBox(nx, ny, nz, values.size());
  const ValueCheck check = checkBox(nx, ny, nz, 1, values.data());
  check.require();
  auto grid = empty();
  grid->maximum_ = check.maximum;
  grid->indexToWorld_ = unitCubeMap(nx, ny, nz);
  grid->storage_->dense = std::move(values);
  GridView& view = grid->view_;
  view.kind = GridView::Kind::dense;
  view.dense = {grid->storage_->dense.data(), nx, ny, nz};
  view.supportLo = Vec3(-0.5f);
  view.supportHi = {static_cast<float>(nx) - 0.5f, static_cast<float>(ny) - 0.5f, static_cast<float>(nz) - 0.5f};
  const CoarseLayout layout = coarseLayout({-0.5, -0.5, -0.5}, {nx - 0.5, ny - 0.5, nz - 0.5}, options);
  grid->storage_->coarse = coarsen(view.dense, {0, 0, 0}, layout);
  setCoarse(view, grid->storage_->coarse, layout);
  return grid;
}

std::shared_ptr<const Grid> GridFactory::tree(AlignedBytes bytes, const GridOptions& options) {
  auto* tree = reinterpret_cast<nanovdb::FloatGrid*>(bytes.data());
  auto grid = empty();
  grid->indexToWorld_ = mapOf(tree->map());
  const TreeContent content = takeStock(*tree);
  content.requireSound();
  grid->maximum_ = std::max(content.maximum, content.background);
  const Support support(content);
  grid->view_.background = content.background;
  grid->view_.supportLo = toVec3(support.lo);
  grid->view_.supportHi = toVec3(support.hi);
  if (denseIsAffordable(support, bytes.size(), options))
    fillDense(*grid, content);
  else
    keepTree(*grid, std::move(bytes));
  const CoarseLayout layout = coarseLayout(support.lo, support.hi, options);
  grid->storage_->coarse = grid->view_.kind == GridView::Kind::dense ? coarsen(grid->view_.dense, support.lo, layout)
                                                                     : coarsen(content, layout);
  setCoarse(grid->view_, grid->storage_->coarse, layout);
  return grid;
}

void GridFactory::fillDense(Grid& grid, const TreeContent& content) {
  const Support support(content);
  std::array<int64_t, 3> n{};
  for (size_t a = 0; a < 3; ++a) n[a] = static_cast<int64_t>(support.voxels(a));
  grid.storage_->dense.assign(static_cast<size_t>(n[0] * n[1] * n[2]), content.background);
  DenseFiller filler(grid.storage_->dense, support, n);
  for (const TreeTile& tile : content.tiles) filler.add(tile);
  parallelFor(static_cast<int64_t>(content.leaves.size()), 64,
              [&](int64_t i) { filler.add(content.leaves[static_cast<size_t>(i)]); });
  grid.view_.kind = GridView::Kind::dense;
  grid.view_.denseOrigin = toVec3(support.lo);
  grid.view_.dense = {grid.storage_->dense.data(), static_cast<int>(n[0]), static_cast<int>(n[1]),
                      static_cast<int>(n[2])};
}

void GridFactory::keepTree(Grid& grid, AlignedBytes bytes) {
  grid.storage_->tree = std::move(bytes);
  grid.view_.kind = GridView::Kind::sparse;
  grid.view_.sparse.grid = reinterpret_cast<const nanovdb::FloatGrid*>(grid.storage_->tree.data());
}

RgbGrid::RgbGrid(int nx, int ny, int nz, std::vector<Rgb> values)
    : nx_(nx), ny_(ny), nz_(nz), values_(std::move(values)) {
  static_assert(sizeof(Rgb) == 3 * sizeof(float));
  requireBox(nx, ny, nz, values_.size());
  checkBox(nx, ny, nz, 3, &values_.front().r).require();
}

RgbGrid RgbGrid::grey(int nx, int ny, int nz, const std::vector<float>& values) {
  requireBox(nx, ny, nz, values.size());
  checkBox(nx, ny, nz, 1, values.data()).require();  // a bad value counts once
  std::vector<Rgb> colours;
  colours.reserve(values.size());
  for (const float value : values) colours.emplace_back(value);
  return RgbGrid(nx, ny, nz, std::move(colours));
}

std::shared_ptr<const Grid> RgbGrid::largestChannel() const {
  std::vector<float> largest;
  largest.reserve(values_.size());
  for (Rgb value : values_) largest.push_back(maxComponent(value));
  return Grid::dense(nx_, ny_, nz_, std::move(largest));
}

float RgbGrid::maximum() const {
  float best = 0;
  for (Rgb value : values_) best = std::max(best, maxComponent(value));
  return best;
}

}  // namespace virga
