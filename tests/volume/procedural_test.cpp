// SPDX-License-Identifier: Apache-2.0
#include "volume/procedural.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace virga {
namespace {

constexpr ProceduralKind kKinds[] = {ProceduralKind::smoke, ProceduralKind::cloud, ProceduralKind::fog,
                                     ProceduralKind::dust};

DenseVolume make(ProceduralKind kind, float frame = 0, uint32_t seed = 1, int resolution = 48) {
  return makeProcedural(kind, {.resolution = resolution, .seed = seed, .frame = frame});
}

double meanOf(const DenseVolume& v) {
  double sum = 0;
  for (float x : v.values) sum += static_cast<double>(x);
  return sum / static_cast<double>(v.values.size());
}

double meanDifference(const DenseVolume& a, const DenseVolume& b) {
  double sum = 0;
  for (size_t n = 0; n < a.values.size(); ++n) sum += std::fabs(static_cast<double>(a.values[n] - b.values[n]));
  return sum / static_cast<double>(a.values.size());
}

// Mean of the slices y in [from, to) as shares of the height.
double meanOfLayer(const DenseVolume& v, double from, double to) {
  double sum = 0;
  int count = 0;
  for (int y = static_cast<int>(from * v.ny); y < static_cast<int>(to * v.ny); ++y)
    for (int z = 0; z < v.nz; ++z)
      for (int x = 0; x < v.nx; ++x, ++count)
        sum += static_cast<double>(v.values[static_cast<size_t>((z * v.ny + y) * v.nx + x)]);
  return sum / count;
}

TEST(Procedural, FillsTheCubeWithValuesUpToOne) {
  for (ProceduralKind kind : kKinds) {
    const DenseVolume v = make(kind);
    ASSERT_EQ(v.values.size(), size_t{48} * 48 * 48);
    const auto [lo, hi] = std::minmax_element(v.values.begin(), v.values.end());
    EXPECT_GE(*lo, 0);
    EXPECT_LE(*hi, 1);
    EXPECT_GT(*hi, 0.4f);
    const Affine map(v.indexToWorld);
    EXPECT_NEAR(map.point(Vec3(-0.5f)).x, -1, 1e-6f);
    EXPECT_NEAR(map.point(Vec3(47.5f)).y, 1, 1e-6f);
  }
}

TEST(Procedural, DependsOnSeedAndFrameOnly) {
  for (ProceduralKind kind : kKinds) {
    const DenseVolume v = make(kind);
    {
      const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
      EXPECT_EQ(make(kind).values, v.values);
    }
    EXPECT_GT(meanDifference(make(kind, 0, 2), v), 0.05 * meanOf(v)) << "seeds differ";
    EXPECT_NE(make(kind, 1).values, v.values) << "frames differ";
  }
}

TEST(Procedural, SequencesAreCoherent) {
  for (ProceduralKind kind : kKinds) {
    const DenseVolume first = make(kind, 10), next = make(kind, 11), late = make(kind, 60);
    EXPECT_LT(meanDifference(first, next), 0.25 * meanOf(first));
    EXPECT_GT(meanDifference(first, late), 2 * meanDifference(first, next)) << "motion goes on";
  }
}

TEST(Procedural, SmokeRises) {
  const auto center = [](const DenseVolume& v) {
    double sum = 0, weighted = 0;
    for (size_t n = 0; n < v.values.size(); ++n) {
      const auto y = static_cast<double>(n / static_cast<size_t>(v.nx) % static_cast<size_t>(v.ny));
      sum += static_cast<double>(v.values[n]), weighted += static_cast<double>(v.values[n]) * y;
    }
    return weighted / sum;
  };
  const double y0 = center(make(ProceduralKind::smoke, 0)), y1 = center(make(ProceduralKind::smoke, 16));
  EXPECT_GT(y1, y0 + 0.5);
}

TEST(Procedural, ShapesAreWhatTheyAreCalled) {
  const DenseVolume smoke = make(ProceduralKind::smoke), cloud = make(ProceduralKind::cloud);
  const auto empty = [](const DenseVolume& v) {
    return static_cast<double>(std::count(v.values.begin(), v.values.end(), 0.f)) /
           static_cast<double>(v.values.size());
  };
  EXPECT_GT(empty(smoke), 0.6) << "a plume stands in empty space";
  EXPECT_GT(empty(cloud), 0.5);
  const DenseVolume fog = make(ProceduralKind::fog), dust = make(ProceduralKind::dust);
  EXPECT_GT(meanOfLayer(fog, 0, 0.2), 5 * meanOfLayer(fog, 0.5, 0.7));
  EXPECT_GT(meanOfLayer(dust, 0, 0.2), 1.3 * meanOfLayer(dust, 0.8, 1));
  EXPECT_LT(empty(dust), 0.05) << "dust fills the room";
  const DenseVolume coarse = make(ProceduralKind::smoke, 0, 1, 24);
  EXPECT_NEAR(meanOf(coarse), meanOf(smoke), 0.15 * meanOf(smoke)) << "resolution changes detail, not the amount";
}

TEST(Procedural, RefusesNonsense) {
  EXPECT_THROW(make(ProceduralKind::fog, 0, 0, 1), Error);
  EXPECT_THROW(make(ProceduralKind::fog, 0, 0, 100000), Error);
  EXPECT_THROW(make(ProceduralKind::fog, std::nanf("")), Error);
  EXPECT_EQ(proceduralKind("cloud"), ProceduralKind::cloud);
  try {
    proceduralKind("smok");
    ADD_FAILURE();
  } catch (const Error& e) {
    EXPECT_STREQ(
        e.what(),
        "error: unknown kind of volume \"smok\"; did you mean \"smoke\"?\n  note: available: smoke, cloud, fog, dust");
  }
}

}  // namespace
}  // namespace virga
