// SPDX-License-Identifier: Apache-2.0
#include "volume/grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "core/error.h"
#include "volume/samples.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using Storage = GridOptions::Storage;
using GridPtr = std::shared_ptr<const Grid>;
using test::SampleGrid;

GridPtr noisyBox(int nx, int ny, int nz, const GridOptions& options = {}) {
  test::Sequence random(3);
  std::vector<float> values(static_cast<size_t>(nx * ny * nz));
  for (float& v : values) v = random.next() < 0.3 ? 0.f : static_cast<float>(random.next());
  return Grid::dense(nx, ny, nz, std::move(values), options);
}

GridPtr viaVdb(const SampleGrid& sample, const GridOptions& options) {
  const test::TemporaryFolder folder;
  test::writeVdbSample(folder / "a.vdb", {sample});
  return loadVolume(folder / "a.vdb", {}, options);
}

Vec3 pointInCell(const GridView& view, int i, int j, int k, test::Sequence& random) {
  const CoarseGridView& coarse = view.majorant;
  const int cell[] = {i, j, k};
  Vec3 p;
  for (int a = 0; a < 3; ++a) {
    // Every fourth coordinate lies on the cell's border.
    const double u = random.below(4) == 0 ? random.below(2) : random.next();
    const double lo = static_cast<double>(coarse.origin[a]) + cell[a] * static_cast<double>(coarse.cellSize[a]);
    const double hi = std::min(lo + static_cast<double>(coarse.cellSize[a]), static_cast<double>(view.supportHi[a]));
    p[a] = static_cast<float>(lo + u * (hi - lo));
  }
  return p;
}

struct BoundReport {
  int violations = 0;
  double worstTightness = 1;  // least ratio of the greatest value found in a cell to its majorant
};

BoundReport probe(const GridView& view, const std::vector<float>& majorant, int pointsPerCell) {
  test::Sequence random(11);
  BoundReport report;
  size_t n = 0;
  for (int k = 0; k < view.majorant.nz; ++k)
    for (int j = 0; j < view.majorant.ny; ++j)
      for (int i = 0; i < view.majorant.nx; ++i, ++n) {
        float best = 0;
        for (int s = 0; s < pointsPerCell; ++s) best = std::max(best, view.lookup(pointInCell(view, i, j, k, random)));
        if (best > majorant[n]) ++report.violations;
        if (majorant[n] > 0)
          report.worstTightness = std::min(report.worstTightness, static_cast<double>(best / majorant[n]));
      }
  return report;
}

std::vector<float> majorantsOf(const GridView& view) {
  const CoarseGridView& m = view.majorant;
  return {m.values, m.values + static_cast<size_t>(m.nx) * static_cast<size_t>(m.ny) * static_cast<size_t>(m.nz)};
}

// Sum over cells of mean times the volume inside the support.
double integralOfMeans(const GridView& view) {
  const CoarseGridView& mean = view.mean;
  double sum = 0;
  for (int k = 0; k < mean.nz; ++k)
    for (int j = 0; j < mean.ny; ++j)
      for (int i = 0; i < mean.nx; ++i) {
        const int cell[] = {i, j, k};
        double volume = 1;
        for (int a = 0; a < 3; ++a) {
          const double lo = static_cast<double>(mean.origin[a]) + cell[a] * static_cast<double>(mean.cellSize[a]);
          volume *= std::min(static_cast<double>(mean.cellSize[a]), static_cast<double>(view.supportHi[a]) - lo);
        }
        sum += static_cast<double>(mean.cell(i, j, k)) * volume;
      }
  return sum;
}

struct GridCase {
  std::string name;
  GridPtr grid;
};

std::vector<GridCase> gridCases() {
  const SampleGrid lumps = test::lumpyGrid(), raised = test::lumpyGrid(0.05f);
  return {{"box, default cells", noisyBox(37, 21, 18)},
          {"box, cells of 4", noisyBox(16, 16, 16, {.cellSize = 4})},
          {"box, cells of 1", noisyBox(9, 7, 5, {.cellSize = 1})},
          {"thin box", noisyBox(40, 1, 2)},
          {"dense VDB", viaVdb(lumps, {.storage = Storage::dense})},
          {"sparse VDB", viaVdb(lumps, {.storage = Storage::sparse})},
          {"sparse VDB, cells of 3", viaVdb(lumps, {.cellSize = 3, .storage = Storage::sparse})},
          {"sparse VDB, background", viaVdb(raised, {.storage = Storage::sparse})},
          {"dense VDB, background", viaVdb(raised, {.storage = Storage::dense})}};
}

TEST(Majorant, BoundsTheInterpolantInEveryCell) {
  for (const GridCase& c : gridCases()) {
    const std::vector<float> majorant = majorantsOf(c.grid->view());
    EXPECT_EQ(probe(c.grid->view(), majorant, 200).violations, 0) << c.name;
    std::vector<float> shrunk = majorant;
    *std::max_element(shrunk.begin(), shrunk.end()) *= 0.7f;
    if (c.grid->view().majorant.cellSize.x > 4) continue;  // the top of a large cell is rarely hit by chance
    EXPECT_GT(probe(c.grid->view(), shrunk, 3000).violations, 0) << "the test cannot fail: " << c.name;
  }
}

// Voxel centres and borders of cells are the only places where the maximum can be, so these are what to look at.
TEST(Majorant, IsTheMaximumNotMore) {
  for (const GridCase& c : gridCases()) {
    const GridView& view = c.grid->view();
    const std::vector<float> majorant = majorantsOf(view);
    size_t n = 0;
    for (int k = 0; k < view.majorant.nz; ++k)
      for (int j = 0; j < view.majorant.ny; ++j)
        for (int i = 0; i < view.majorant.nx; ++i, ++n) {
          const int cell[] = {i, j, k};
          std::vector<float> places[3];
          for (int a = 0; a < 3; ++a) {
            const float lo = view.majorant.origin[a] + static_cast<float>(cell[a]) * view.majorant.cellSize[a];
            const float hi = std::min(lo + view.majorant.cellSize[a], view.supportHi[a]);
            places[a] = {lo, hi};
            for (float x = std::ceil(lo); x <= hi; ++x) places[a].push_back(x);
          }
          float best = 0;
          for (float x : places[0])
            for (float y : places[1])
              for (float z : places[2]) best = std::max(best, view.lookup({x, y, z}));
          ASSERT_GE(majorant[n], best) << c.name;
          ASSERT_LE(majorant[n], std::max(best * 1.00001f, view.background * 1.00001f)) << c.name;
        }
  }
}

TEST(Majorant, CellsCoverTheSupport) {
  for (const GridCase& c : gridCases()) {
    const GridView& view = c.grid->view();
    const Vec3 end = view.majorant.origin + view.majorant.cellSize * Vec3(static_cast<float>(view.majorant.nx),
                                                                          static_cast<float>(view.majorant.ny),
                                                                          static_cast<float>(view.majorant.nz));
    EXPECT_EQ(view.majorant.origin, view.supportLo) << c.name;
    for (int a = 0; a < 3; ++a) {
      EXPECT_GE(end[a], view.supportHi[a]) << c.name;
      EXPECT_LT(end[a] - view.majorant.cellSize[a], view.supportHi[a]) << c.name;
    }
  }
}

TEST(Majorant, CellsFollowTheOptions) {
  EXPECT_EQ(noisyBox(128, 128, 128)->view().majorant.nx, 16);
  EXPECT_EQ(noisyBox(20, 20, 20, {.cellSize = 5})->view().majorant.nx, 4);
  EXPECT_EQ(noisyBox(100, 4, 4, {.cellSize = 1, .maxCells = 30})->view().majorant.nx, 25);
}

TEST(Mean, KeepsTheIntegralOfBoxes) {
  // Clamped at the border, every voxel of a box has weight 1 in the integral.
  for (int cellSize : {0, 1, 3, 8}) {
    const GridPtr grid = noisyBox(37, 21, 18, {.cellSize = cellSize});
    const float* v = grid->view().dense.values;
    const double exact = std::accumulate(v, v + 37 * 21 * 18, 0.0);
    EXPECT_NEAR(integralOfMeans(grid->view()), exact, 1e-5 * exact) << cellSize;
  }
}

TEST(Mean, KeepsTheIntegralOfTrees) {
  const SampleGrid sample = test::lumpyGrid();
  double exact = 0;
  for (int z = -22; z < 34; ++z)
    for (int y = -22; y < 34; ++y)
      for (int x = -22; x < 60; ++x) exact += static_cast<double>(sample.at(x, y, z));
  for (Storage storage : {Storage::dense, Storage::sparse})
    for (int cellSize : {0, 3}) {
      const GridPtr grid = viaVdb(sample, {.cellSize = cellSize, .storage = storage});
      EXPECT_NEAR(integralOfMeans(grid->view()), exact, 1e-5 * exact) << cellSize;
    }
}

TEST(Mean, IsTheAverageOfEachCell) {
  for (const GridCase& c : gridCases()) {
    const GridView& view = c.grid->view();
    test::Sequence random(23);
    for (int n = 0; n < 6; ++n) {
      const int i = random.below(view.mean.nx), j = random.below(view.mean.ny), k = random.below(view.mean.nz);
      double sum = 0, squares = 0;
      const int samples = 20000;
      for (int s = 0; s < samples; ++s) {
        Vec3 p;
        const int cell[] = {i, j, k};
        for (int a = 0; a < 3; ++a) {
          const float lo = view.mean.origin[a] + static_cast<float>(cell[a]) * view.mean.cellSize[a];
          p[a] =
              lo + static_cast<float>(random.next()) * (std::min(lo + view.mean.cellSize[a], view.supportHi[a]) - lo);
        }
        const double v = static_cast<double>(view.lookup(p));
        sum += v, squares += v * v;
      }
      const double average = sum / samples,
                   error = std::sqrt(std::max(0.0, squares / samples - average * average) / samples);
      EXPECT_NEAR(static_cast<double>(view.mean.cell(i, j, k)), average, 5 * error + 1e-6) << c.name;
    }
  }
}

TEST(Dense, FollowsTheConventionsOfVol) {
  const GridPtr grid = Grid::dense(2, 1, 1, {1.f, 3.f});
  const GridView& view = grid->view();
  EXPECT_EQ(view.lookup({0, 0, 0}), 1);
  EXPECT_EQ(view.lookup({0.5f, 0, 0}), 2);
  EXPECT_EQ(view.lookup({1.5f, 0.5f, -0.5f}), 3) << "clamped beyond the outermost centre";
  EXPECT_EQ(view.lookup({1.51f, 0, 0}), 0) << "nothing outside the box";
  const Affine map(grid->indexToWorld());
  EXPECT_EQ(map.point({0, 0, 0}), Vec3(0.25f, 0.5f, 0.5f)) << "the centre of voxel 0 of 2 lies at a quarter";
  EXPECT_EQ(map.point({1.5f, 0.5f, 0.5f}), Vec3(1, 1, 1));
}

TEST(Sparse, LookupEqualsItsPlainTwin) {
  const SampleGrid sample = test::lumpyGrid(0.05f);
  const GridPtr sparse = viaVdb(sample, {.storage = Storage::sparse}),
                dense = viaVdb(sample, {.storage = Storage::dense});
  ASSERT_EQ(sparse->view().kind, GridView::Kind::sparse);
  ASSERT_EQ(dense->view().kind, GridView::Kind::dense);
  test::Sequence random(7);
  for (int n = 0; n < 100000; ++n) {
    const Vec3 p(static_cast<float>(random.next() * 50 - 14), static_cast<float>(random.next() * 60 - 24),
                 static_cast<float>(random.next() * 42 - 6));
    const double plain =
        sample.interpolated(static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z));
    ASSERT_NEAR(static_cast<double>(sparse->view().lookup(p)), plain, 1e-5) << p.x << " " << p.y << " " << p.z;
    ASSERT_NEAR(static_cast<double>(dense->view().lookup(p)), plain, 1e-5) << p.x << " " << p.y << " " << p.z;
  }
}

TEST(Sparse, SupportEndsOneVoxelBeyondTheActiveOnes) {
  SampleGrid sample;
  sample.fills.push_back({{4, 5, 6}, {10, 11, 12}, 2.f});
  const GridPtr grid = viaVdb(sample, {});
  EXPECT_EQ(grid->view().supportLo, Vec3(3, 4, 5));
  EXPECT_EQ(grid->view().supportHi, Vec3(11, 12, 13));
  EXPECT_EQ(grid->view().lookup({3.5f, 6, 8}), 1);
  EXPECT_EQ(grid->view().lookup({2.9f, 6, 8}), 0);
}

TEST(Sparse, CostsWhatIsActive) {
  SampleGrid few;
  for (int n = 0; n < 40; ++n) few.fills.push_back({{25 * n, 25 * n, 24 * n}, {25 * n, 25 * n, 24 * n}, 1.f});
  const GridPtr grid = viaVdb(few, {});
  EXPECT_EQ(grid->view().kind, GridView::Kind::sparse);
  EXPECT_LT(grid->bytes(), 12u << 20) << "a dense box would take 3.6 GB";
  EXPECT_EQ(grid->view().lookup({250, 250, 240}), 1);
}

TEST(Sparse, BearsHugeExtents) {
  for (int far : {1 << 20, 1 << 29}) {
    SampleGrid sample;
    sample.fills.push_back({{-far, 3, -far}, {-far, 3, -far}, 2.f});
    sample.fills.push_back({{far, 3, far}, {far, 3, far}, 4.f});
    const GridPtr grid = viaVdb(sample, {});
    const GridView& view = grid->view();
    EXPECT_LT(grid->bytes(), 8u << 20);
    EXPECT_LE(view.majorant.nx, 64);
    const Vec3 place(static_cast<float>(far), 3, static_cast<float>(far));
    EXPECT_EQ(view.lookup(place), 4);
    EXPECT_GE(view.majorant.cell(view.majorant.nx - 1, 0, view.majorant.nz - 1), 4);
    const std::vector<float> majorant = majorantsOf(view);
    EXPECT_NEAR(static_cast<double>(std::accumulate(majorant.begin(), majorant.end(), 0.f)), 6, 1e-4);
    // Beyond 2^24 single precision cannot say where the support ends, so there is no volume to multiply by.
    if (far < 1 << 24) {
      EXPECT_NEAR(integralOfMeans(view), 6, 1e-4);
    }
  }
}

TEST(Sparse, RefusesIndicesBeyondWhatFloatsReach) {
  SampleGrid sample;
  sample.fills.push_back({{(1 << 30) + 4096, 0, 0}, {(1 << 30) + 4096, 0, 0}, 1.f});
  EXPECT_THROW(viaVdb(sample, {}), Error);
}

TEST(Constant, IsTheSameEverywhere) {
  const GridPtr grid = Grid::constant(1.5f);
  EXPECT_EQ(grid->view().lookup({-1e6f, 0, 3}), 1.5f);
  EXPECT_EQ(grid->maximum(), 1.5f);
  EXPECT_THROW(Grid::constant(-1), Error);
  EXPECT_THROW(Grid::constant(std::nanf("")), Error);
}

std::string messageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(Values, BadOnesAreCountedAndLocated) {
  std::vector<float> values(4 * 3 * 2, 1.f);
  values[23] = std::nanf("");
  values[17] = -2;  // (1, 1, 1)
  values[20] = -1e-30f;
  values[21] = kInfinity;
  EXPECT_EQ(messageOf([&] { Grid::dense(4, 3, 2, values); }),
            "error: grid has bad values: 1 NaN, 1 infinite, 2 negative; the first is at index (1, 1, 1)");
  EXPECT_EQ(messageOf([&] { Grid::dense(4, 3, 3, values); }), "error: grid of 4 x 3 x 3 voxels has 24 values");
  EXPECT_EQ(messageOf([&] { Grid::dense(0, 3, 3, {}); }), "error: grid of 0 x 3 x 3 voxels has none");
  EXPECT_EQ(messageOf([&] { RgbGrid(1, 1, 1, {Rgb(1, -1, 0)}); }),
            "error: grid has bad values: 1 negative; the first is at index (0, 0, 0)");
}

TEST(Values, NegativeZeroIsZero) { EXPECT_EQ(Grid::dense(2, 1, 1, {-0.f, 1.f})->maximum(), 1); }

}  // namespace
}  // namespace virga
