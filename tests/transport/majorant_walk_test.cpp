// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "core/warp.h"
#include "transport/tracking.h"

namespace virga {
namespace {

// A grid whose cells hold their own index.
struct NumberedGrid {
  std::vector<float> values;
  CoarseGridView view;

  NumberedGrid(std::array<int, 3> n, Vec3 origin, Vec3 cellSize) : values(static_cast<size_t>(n[0] * n[1] * n[2])) {
    std::iota(values.begin(), values.end(), 0.f);
    view = {values.data(), n[0], n[1], n[2], origin, cellSize};
  }
  std::array<int, 3> cellOf(float value) const {
    const int i = static_cast<int>(value);
    return {i % view.nx, i / view.nx % view.ny, i / view.nx / view.ny};
  }
  Vec3 count() const { return {static_cast<float>(view.nx), static_cast<float>(view.ny), static_cast<float>(view.nz)}; }
  Vec3 hi() const { return view.origin + view.cellSize * count(); }
};

// How far the point lies outside the cell [cells].
float outside(const NumberedGrid& grid, float value, Vec3 p) {
  float worst = 0;
  const std::array<int, 3> cell = grid.cellOf(value);
  for (int a = 0; a < 3; ++a) {
    const float x = (p[a] - grid.view.origin[a]) / grid.view.cellSize[a],
                c = static_cast<float>(cell[static_cast<size_t>(a)]);
    worst = std::max({worst, c - x, x - c - 1});
  }
  return worst;
}

struct Walked {
  int pieces = 0;
  float end, worst = 0;
};

Walked walk(const NumberedGrid& grid, Vec3 o, Vec3 d, ClippedRange range) {
  Walked w{0, range.t0, 0};
  walkMajorants(grid.view, o, d, range.t0, range.t1, [&](float a, float b, float value) {
    EXPECT_EQ(a, w.end) << "a gap or an overlap";
    EXPECT_LT(a, b);
    for (float t : {a, a + 0.5f * (b - a), b}) w.worst = std::max(w.worst, outside(grid, value, o + d * t));
    w.end = b;
    return ++w.pieces <= 1000;
  });
  return w;
}

class RandomRays {
 public:
  explicit RandomRays(uint64_t seed) : random_(seed) {}

  NumberedGrid grid() {
    const auto n = [&] { return 1 + static_cast<int>(9 * random_.next()); };
    return {{n(), n(), n()}, between(Vec3(-20), Vec3(20)), between(Vec3(0.2f), Vec3(9))};
  }
  /// Inside, outside, far away, on borders of cells.
  Vec3 origin(const NumberedGrid& g) {
    const Vec3 size = g.hi() - g.view.origin;
    if (random_.next() < 0.1f)
      return g.view.origin + size * 0.5f + uniformSphere({random_.next(), random_.next()}) * 1e4f;
    Vec3 p = between(g.view.origin - size, g.hi() + size);
    for (int a = 0; a < 3; ++a)
      if (random_.next() < 0.3f) p[a] = border(g, a);
    return p;
  }
  Vec3 direction(const NumberedGrid& g, Vec3 from) {
    Vec3 d = uniformSphere({random_.next(), random_.next()});
    const float kind = random_.next();
    if (kind < 0.4f) d = Vec3(border(g, 0), border(g, 1), border(g, 2)) - from;  // at a corner
    if (kind < 0.5f) d = g.view.origin + (g.hi() - g.view.origin) * 0.5f - from;
    for (int a = 0; a < 3; ++a) {
      const float u = random_.next();
      if (u < 0.15f) d[a] = 0;
      if (u > 0.9f) d[a] *= 1e-7f;
      if (u > 0.97f) d[a] = 1e-38f;
    }
    return d;
  }

 private:
  Vec3 between(Vec3 lo, Vec3 hi) { return lo + (hi - lo) * Vec3(random_.next(), random_.next(), random_.next()); }
  float border(const NumberedGrid& g, int a) {
    const float i = std::floor((g.count()[a] + 1) * random_.next());
    return g.view.origin[a] + g.view.cellSize[a] * i;
  }
  Pcg32 random_;
};

TEST(WalkMajorants, CoversTheRangeInOrderThroughTheRightCells) {
  RandomRays rays(1);
  int met = 0;
  for (int i = 0; i < 200'000; ++i) {
    const NumberedGrid grid = rays.grid();
    const Vec3 o = rays.origin(grid), d = rays.direction(grid, o);
    const ClippedRange range = clipToBox(o, d, grid.view.origin, grid.hi(), 0, kInfinity);
    if (!(range.t0 < range.t1) || std::isinf(range.t1)) continue;
    ++met;
    const Walked w = walk(grid, o, d, range);
    ASSERT_EQ(w.end, range.t1) << "ray " << i;
    ASSERT_LE(w.pieces, grid.view.nx + grid.view.ny + grid.view.nz) << "ray " << i;
    // Positions along the ray are known to some units in the last place of the largest number they come from.
    const float largest = std::max(maxComponent(abs(o)), maxComponent(max(abs(grid.view.origin), abs(grid.hi()))));
    const float tolerance = 1e-6f * largest / minComponent(grid.view.cellSize);
    ASSERT_LE(w.worst, tolerance) << "ray " << i << ", " << w.pieces << " pieces";
  }
  EXPECT_GT(met, 50'000);
}

TEST(WalkMajorants, VisitsEveryCellOfARowOnce) {
  const NumberedGrid grid({7, 3, 3}, Vec3(0), Vec3(2));
  for (const bool forward : {true, false}) {
    std::vector<int> seen;
    const Vec3 o = forward ? Vec3(0, 3, 3) : Vec3(14, 3, 3), d(forward ? 0.5f : -0.5f, 0, 0);
    walkMajorants(grid.view, o, d, 0, 28, [&](float a, float b, float value) {
      EXPECT_EQ(b - a, 4);
      seen.push_back(grid.cellOf(value)[0]);
      return true;
    });
    EXPECT_EQ(seen, (forward ? std::vector<int>{0, 1, 2, 3, 4, 5, 6} : std::vector<int>{6, 5, 4, 3, 2, 1, 0}));
  }
}

TEST(WalkMajorants, StopsWhenTold) {
  const NumberedGrid grid({8, 1, 1}, Vec3(0), Vec3(1));
  int visited = 0;
  EXPECT_FALSE(
      walkMajorants(grid.view, {0, 0.5f, 0.5f}, {1, 0, 0}, 0, 8, [&](float, float, float) { return ++visited < 3; }));
  EXPECT_EQ(visited, 3);
  EXPECT_TRUE(walkMajorants(grid.view, {0, 0.5f, 0.5f}, {1, 0, 0}, 0, 8, [&](float, float, float) { return true; }));
}

TEST(WalkMajorants, ARayThatStandsStillStaysInItsCell) {
  const NumberedGrid grid({4, 4, 4}, Vec3(0), Vec3(1));
  int visited = 0;
  walkMajorants(grid.view, {1.5f, 2.5f, 3.5f}, {0, 0, 0}, 0, 5, [&](float a, float b, float value) {
    EXPECT_EQ(a, 0);
    EXPECT_EQ(b, 5);
    EXPECT_EQ(grid.cellOf(value), (std::array<int, 3>{1, 2, 3}));
    return ++visited < 100;
  });
  EXPECT_EQ(visited, 1);
}

TEST(ForEachMajorant, CoversARayWithItsBackground) {
  // A grid view without values: only its majorants, support and background are looked at.
  const NumberedGrid grid({4, 2, 2}, Vec3(0), Vec3(1));
  GridView view;
  view.kind = GridView::Kind::dense;
  view.supportLo = grid.view.origin, view.supportHi = grid.hi();
  view.majorant = grid.view;
  for (const float background : {0.f, 0.25f})
    for (const float y : {0.5f, 1.f, 5.f}) {
      view.background = background;
      float end = -1, insideLength = 0, outsideLength = 0;
      forEachMajorant(view, {-3, y, 0.5f}, {1, 0, 0}, 0, 20, [&](float a, float b, float majorant, bool inside) {
        if (background > 0) {
          EXPECT_EQ(a, std::max(end, 0.f));
        }
        EXPECT_TRUE(inside || majorant == background);
        (inside ? insideLength : outsideLength) += b - a;
        end = b;
        return true;
      });
      EXPECT_EQ(insideLength, y < 2 ? 4 : 0);
      EXPECT_EQ(outsideLength, background > 0 ? 20 - insideLength : 0);
    }
}

}  // namespace
}  // namespace virga
