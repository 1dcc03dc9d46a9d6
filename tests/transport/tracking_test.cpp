// SPDX-License-Identifier: Apache-2.0
// Free flights and transmittance against optical depths that are integrated exactly.
#include "transport/tracking.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stats/stats.h"
#include "transport/fields.h"

namespace virga {
namespace {

using test::Field;
using test::OpticalDepth;
using test::RayPart;

constexpr int kFlights = 40'000;
constexpr double kWrong = 1.06;  // factor of the optical depth that the tests must notice

std::vector<float> flights(const Field& field, const RayPart& part, uint64_t seed) {
  Pcg32 random(seed);
  std::vector<float> result;
  for (int i = 0; i < kFlights; ++i)
    result.push_back(sampleFreeFlight(field.medium, part.ray, part.t0, part.t1, random));
  return result;
}

// Kolmogorov-Smirnov test of 1 - exp(-depth), which is uniform. A flight that met nothing stands for one that goes on.
double flightP(const std::vector<float>& flights, const OpticalDepth& depth, double factor = 1) {
  Pcg32 random(99);
  std::vector<double> uniform;
  const double escaped = std::exp(-factor * depth.total());
  for (float t : flights)
    uniform.push_back(std::isinf(t) ? 1 - escaped * static_cast<double>(random.next())
                                    : 1 - std::exp(-factor * depth.until(static_cast<double>(t))));
  return stats::kolmogorovSmirnov(uniform, [](double u) { return u; });
}

TEST(FreeFlight, FollowsTheOpticalDepth) {
  for (const Field& field : test::fields())
    for (const RayPart& part : test::raysThrough(field)) {
      SCOPED_TRACE(field.name + ", " + part.name);
      const OpticalDepth depth(field, part);
      const std::vector<float> drawn = flights(field, part, 1);
      for (float t : drawn) ASSERT_TRUE(std::isinf(t) || (t >= part.t0 && t <= part.t1)) << t;
      EXPECT_GT(flightP(drawn, depth), 1e-4) << depth.total();
      if (depth.total() > 0.4) {
        EXPECT_LT(flightP(drawn, depth, kWrong), 1e-4) << "the test cannot fail";
      }
    }
}

TEST(FreeFlight, MeetsNothingWhereNothingIs) {
  int empty = 0;
  for (const Field& field : test::fields())
    for (const RayPart& part : test::raysThrough(field)) {
      if (OpticalDepth(field, part).total() > 0) continue;
      ++empty;
      for (float t : flights(field, part, 2)) ASSERT_EQ(t, kInfinity) << field.name << ", " << part.name;
    }
  EXPECT_GT(empty, 10);
}

TEST(FreeFlight, SkipsHoles) {
  const Field& field = test::fields()[4];
  ASSERT_EQ(field.name, "dense, holes");
  Pcg32 random(3);
  int found = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Ray ray{{-3, 11 * random.next(), 8 * random.next()},
                  normalize(Vec3(1, random.next() - 0.5f, random.next() - 0.5f))};
    const float t = sampleFreeFlight(field.medium, ray, 0, kInfinity, random);
    if (std::isinf(t)) continue;
    ++found;
    const Vec3 p = ray.at(t);
    ASSERT_GT(field.density({p.x, p.y, p.z}), 0) << p.x << " " << p.y << " " << p.z;
  }
  EXPECT_GT(found, 5000);
}

TEST(FreeFlight, OfNoExtinctionNeverEnds) {
  for (Field field : test::fields()) {
    field.medium.sigmaT = 0;
    for (const RayPart& part : test::raysThrough(field)) {
      Pcg32 random(4);
      for (int i = 0; i < 100; ++i) {
        ASSERT_EQ(sampleFreeFlight(field.medium, part.ray, part.t0, part.t1, random), kInfinity) << field.name;
        ASSERT_EQ(estimateTransmittance(field.medium, part.ray, part.t0, part.t1, random), Rgb(1.f)) << field.name;
      }
    }
  }
}

TEST(FreeFlight, OfAnEmptyPartMeetsNothing) {
  for (const Field& field : test::fields()) {
    Pcg32 random(5);
    const Ray ray{field.medium.homogeneous ? Vec3() : Affine(field.indexToWorld).point(Vec3(5)), Vec3(0, 0, 1)};
    for (int i = 0; i < 1000; ++i) {
      ASSERT_EQ(sampleFreeFlight(field.medium, ray, 2, 2, random), kInfinity) << field.name;
      ASSERT_EQ(estimateTransmittance(field.medium, ray, 2, 2, random), Rgb(1.f)) << field.name;
    }
  }
}

stats::Moments transmittances(const Field& field, const RayPart& part, int count, uint64_t seed) {
  Pcg32 random(seed);
  stats::Moments moments;
  for (int i = 0; i < count; ++i) {
    const Rgb t = estimateTransmittance(field.medium, part.ray, part.t0, part.t1, random);
    EXPECT_TRUE(isGrey(t) && t.r >= 0 && t.r <= 1) << t.r;
    moments.add(static_cast<double>(t.r));
  }
  return moments;
}

TEST(Transmittance, IsUnbiased) {
  uint64_t seed = 1000;
  for (const Field& field : test::fields())
    for (const RayPart& part : test::raysThrough(field)) {
      SCOPED_TRACE(field.name + ", " + part.name);
      const OpticalDepth depth(field, part);
      const double truth = std::exp(-depth.total()), wrong = std::exp(-kWrong * depth.total());
      const stats::Moments m = transmittances(field, part, kFlights, ++seed);
      if (m.variance() < 1e-12) {
        EXPECT_NEAR(m.mean(), truth, 1e-6);
        continue;
      }
      EXPECT_GT(stats::zTest(m.mean(), truth, m.standardError()), 1e-4) << m.mean() << " instead of " << truth;
      if (depth.total() > 0.4 && depth.total() < 3) {
        EXPECT_LT(stats::zTest(m.mean(), wrong, m.standardError()), 1e-4) << "the test cannot fail";
      }
    }
}

// Many samples of a thick medium: the estimates that survive Russian roulette must make up for those that do not.
TEST(Transmittance, IsUnbiasedInThickMedia) {
  Field field = test::fields()[3];
  field.medium.sigmaT *= 3;
  const RayPart part{"slanted", {{-3, 10, -1}, normalize(Vec3(6, -2, 1.7f))}};
  const double truth = std::exp(-OpticalDepth(field, part).total());
  ASSERT_LT(truth, 5e-3);
  const stats::Moments m = transmittances(field, part, 1'000'000, 7);
  EXPECT_GT(stats::zTest(m.mean(), truth, m.standardError()), 1e-4) << m.mean() << " instead of " << truth;
  EXPECT_LT(stats::zTest(m.mean(), 1.1 * truth, m.standardError()), 1e-4) << "the test cannot fail";
}

TEST(ClipToBox, KeepsWhatLiesInTheBox) {
  const Vec3 lo(-1, 0, 2), hi(3, 1, 5);
  Pcg32 random(8);
  const auto coordinate = [&](int axis) {
    // Often exactly on a plane of the box.
    const float u = random.next();
    return u < 0.2f ? lo[axis] : (u < 0.4f ? hi[axis] : lerp(lo[axis] - 2, hi[axis] + 2, random.next()));
  };
  for (int i = 0; i < 100'000; ++i) {
    const Vec3 o(coordinate(0), coordinate(1), coordinate(2));
    Vec3 d;
    for (int a = 0; a < 3; ++a) d[a] = random.next() < 0.3f ? 0 : 2 * random.next() - 1;
    const ClippedRange range = clipToBox(o, d, lo, hi, 0, 10);
    const auto inside = [&](float t) {
      const Vec3 p = o + d * t, slack(1e-5f);
      return min(p, lo - slack) == lo - slack && max(p, hi + slack) == hi + slack;
    };
    if (range.t0 < range.t1) {
      ASSERT_TRUE(range.t0 >= 0 && range.t1 <= 10 && inside(range.t0) && inside(range.t1));
    } else {
      for (float t : {0.f, 0.1f, 0.7f, 3.f}) {
        const Vec3 p = o + d * t, slack(1e-5f);
        ASSERT_FALSE(min(p, lo + slack) == lo + slack && max(p, hi - slack) == hi - slack);
      }
    }
  }
}

}  // namespace
}  // namespace virga
