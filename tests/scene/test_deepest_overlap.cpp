// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "core/random.h"
#include "scene/deepest_overlap.h"

namespace virga {
namespace {

constexpr int kAny = 1'000'000;

Bounds box(Vec3 lo, Vec3 extent) { return {lo, lo + extent}; }

// The deepest place begins at the lower x of one box, the lower y of another and the lower z of a third.
int plainly(const std::vector<Bounds>& boxes) {
  int deepest = 0;
  for (const Bounds& a : boxes)
    for (const Bounds& b : boxes)
      for (const Bounds& c : boxes) {
        const Vec3 p(a.lo.x, b.lo.y, c.lo.z);
        int depth = 0;
        for (const Bounds& d : boxes) {
          bool inside = true;
          for (int i = 0; i < 3; ++i) inside &= d.lo[i] <= p[i] && p[i] < d.hi[i];
          depth += inside ? 1 : 0;
        }
        deepest = std::max(deepest, depth);
      }
  return deepest;
}

std::vector<Bounds> randomBoxes(int count, float size, uint64_t seed) {
  Pcg32 rng(seed);
  std::vector<Bounds> boxes;
  for (int i = 0; i < count; ++i)
    boxes.push_back(
        box({rng.next(), rng.next(), rng.next()}, Vec3(rng.next() * size, rng.next() * size, rng.next() * size)));
  return boxes;
}

TEST(DeepestOverlap, IsThatOfThePlainSearch) {
  int differing = 0;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const std::vector<Bounds> boxes = randomBoxes(5 + static_cast<int>(seed % 30), seed % 2 ? 0.4f : 1.5f, seed);
    const int expected = plainly(boxes);
    EXPECT_EQ(deepestOverlap(boxes, kAny), expected) << seed;
    EXPECT_EQ(deepestOverlap(boxes, 3), std::min(expected, 3)) << seed;
    differing += expected > 3 ? 1 : 0;
  }
  EXPECT_GT(differing, 10);
}

// Equal faces are where a search that divides could count wrongly.
TEST(DeepestOverlap, OnALattice) {
  for (uint64_t seed = 0; seed < 60; ++seed) {
    Pcg32 rng(seed);
    const auto whole = [&](float n) { return std::floor(rng.next() * n); };
    std::vector<Bounds> boxes;
    for (int i = 0; i < 25; ++i)
      boxes.push_back(box({whole(4), whole(4), whole(4)}, Vec3(whole(4), whole(4), whole(4))));
    EXPECT_EQ(deepestOverlap(boxes, kAny), plainly(boxes)) << seed;
  }
}

TEST(DeepestOverlap, Ends) {
  EXPECT_EQ(deepestOverlap({}, kAny), 0);
  EXPECT_EQ(deepestOverlap({box(Vec3(0), Vec3(1))}, kAny), 1);
  EXPECT_EQ(deepestOverlap(std::vector<Bounds>(20, box(Vec3(0), Vec3(1))), kAny), 20);
  EXPECT_EQ(deepestOverlap({box(Vec3(0), Vec3(1)), box({1, 0, 0}, Vec3(1))}, kAny), 1) << "they touch";
}

// Thousands, in arrangements that are hard for a division of space.
TEST(DeepestOverlap, Thousands) {
  std::vector<Bounds> grid, plates;
  for (int x = 0; x < 16; ++x)
    for (int y = 0; y < 16; ++y)
      for (int z = 0; z < 16; ++z)
        grid.push_back(
            box({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)}, Vec3(1.1f, 1.1f, 1.1f)));
  EXPECT_EQ(deepestOverlap(grid, 9), 8) << "neighbours overlap a little; eight meet at each corner";
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i < 1000; ++i) {
      Bounds plate{Vec3(-1), Vec3(1001)};
      plate.lo[axis] = static_cast<float>(i), plate.hi[axis] = static_cast<float>(i) + 0.5f;
      plates.push_back(plate);
    }
  EXPECT_EQ(deepestOverlap(plates, 9), 3) << "plates of three directions";
  const std::vector<Bounds> crowd = randomBoxes(3000, 0.5f, 5);
  EXPECT_EQ(deepestOverlap(crowd, 9), 9);
}

}  // namespace
}  // namespace virga
