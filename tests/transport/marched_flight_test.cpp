// SPDX-License-Identifier: Apache-2.0
// Flights that are marched, against optical depths that are integrated exactly. They are biased by their steps of
// half a cell: in these fields, whose neighbouring voxels differ by all of their density, by up to kStepBias.
#include "transport/marched_flight.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "image/scratch.h"
#include "scene/scenes.h"
#include "stats/stats.h"
#include "transport/fields.h"
#include "transport/virtual_lights.h"
#include "volume/procedural.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using test::Field;
using test::OpticalDepth;
using test::RayPart;

constexpr int kFlights = 10'000;
constexpr double kStepBias = 0.025;  // of any probability
constexpr double kWrong = 1.3;       // factor of the optical depth that the tests must notice

std::vector<float> flights(const Field& field, const RayPart& part) {
  Pcg32 random(1);
  std::vector<float> result;
  for (int i = 0; i < kFlights; ++i)
    result.push_back(marchFreeFlight(field.medium, part.ray, part.t0, part.t1, random));
  std::sort(result.begin(), result.end());
  return result;
}

/// Largest difference between the probabilities of having ended, by these flights and by the optical depth.
double distanceOf(const std::vector<float>& sorted, const OpticalDepth& depth, double factor = 1) {
  double most = 0;
  const auto count = static_cast<double>(sorted.size());
  for (size_t i = 0; i < sorted.size(); ++i) {
    const bool escaped = std::isinf(sorted[i]);
    const double truth =
        1 - std::exp(-factor * (escaped ? depth.total() : depth.until(static_cast<double>(sorted[i]))));
    most = std::max(most, std::fabs(static_cast<double>(i) / count - truth));
    if (escaped) break;
  }
  return most;
}

TEST(MarchedFlight, FollowsTheOpticalDepth) {
  const double noise = 2.2 / std::sqrt(static_cast<double>(kFlights));  // one in ten thousand exceeds it
  for (const Field& field : test::fields())
    for (const RayPart& part : test::raysThrough(field)) {
      SCOPED_TRACE(field.name + ", " + part.name);
      const OpticalDepth depth(field, part);
      const std::vector<float> drawn = flights(field, part);
      for (float t : drawn) ASSERT_TRUE(std::isinf(t) || (t >= part.t0 && t <= part.t1)) << t;
      EXPECT_LT(distanceOf(drawn, depth), noise + (field.medium.homogeneous ? 0 : kStepBias)) << depth.total();
      if (depth.total() > 0.5) {
        EXPECT_GT(distanceOf(drawn, depth, kWrong), noise + kStepBias) << "the test cannot fail";
      }
    }
}

// Draw for draw the same.
TEST(MarchedFlight, HomogeneousMediaAreExact) {
  MediumView medium;
  medium.sigmaT = 1.5f;
  const Ray ray{{0, 0, 0}, {0, 0, 1}};
  Pcg32 a(3), b(3);
  for (int i = 0; i < 100; ++i)
    EXPECT_EQ(marchFreeFlight(medium, ray, 0, 2, a), sampleFreeFlight(medium, ray, 0, 2, b));
}

// The channels have multiples of one density: weighted by what the flight has noted, each follows its own.
TEST(MarchedFlight, EveryChannelFollowsItsOwnDepth) {
  const Rgb spectrum(1, 0.3f, 0);
  int compared = 0;
  for (const Field& field : test::fields()) {
    MediumView medium = field.medium;
    medium.grey = false, medium.spectrum = spectrum;
    for (const RayPart& part : test::raysThrough(field)) {
      const OpticalDepth depth(field, part);
      if (depth.total() < 0.4) continue;
      SCOPED_TRACE(field.name + ", " + part.name);
      const float until = part.t0 + 0.6f * (std::isinf(part.t1) ? 15 : part.t1 - part.t0);
      Pcg32 random(11);
      stats::Moments ended[3];
      for (int i = 0; i < kFlights; ++i) {
        SpectralFlight flight(Rgb(1.f), random.next());
        const float t = marchFreeFlight(medium, part.ray, part.t0, part.t1, random, flight);
        const Rgb weight = flight.weight(Rgb(1.f));
        for (int c = 0; c < 3; ++c) ended[c].add(t <= until ? static_cast<double>(weight[c]) : 0);
      }
      for (int c = 0; c < 3; ++c) {
        const double truth = 1 - std::exp(-static_cast<double>(spectrum[c]) * depth.until(double{until}));
        EXPECT_NEAR(ended[c].mean(), truth, 4.5 * ended[c].standardError() + kStepBias) << c;
      }
      ++compared;
    }
  }
  EXPECT_GT(compared, 10);
}

/// Weight and height of the lights of each depth, a value for each walk.
struct ByDepth {
  static constexpr int kDepths = 4;
  stats::Moments weight[kDepths], height[kDepths];

  ByDepth(const Scene& scene, FlightMode flights) {
    const VirtualLights all = traceVirtualLights(scene, {.walks = 30'000, .maxDepth = kDepths, .flights = flights},
                                                 {1, flights == FlightMode::marching, 0, 0});
    for (size_t w = 0; w + 1 < all.firstOf.size(); ++w) {
      double weights[kDepths] = {}, heights[kDepths] = {};
      for (size_t i = all.firstOf[w]; i < all.firstOf[w + 1]; ++i) {
        const LightVertex& v = all.lights[i];
        weights[v.depth - 1] += static_cast<double>(mean(v.weight));
        heights[v.depth - 1] += static_cast<double>(mean(v.weight) * v.p.z);
      }
      for (int d = 0; d < kDepths; ++d) weight[d].add(weights[d]), height[d].add(heights[d]);
    }
  }
};

// Coloured smoke under a lamp: the flux that is scattered at each depth, and how high.
TEST(MarchedFlight, WalksCarryTheSameFlux) {
  const auto path = scratchFile("smoke.vol");
  writeVol(path, makeProcedural(ProceduralKind::smoke, {.resolution = 32}));
  const SceneSnapshot scene = test::build(fmt::format(R"(
    <emitter type="point"><point name="position" x="0.5" y="0.5" z="0.5"/></emitter>
    <shape type="cube"><transform name="to_world"><scale value="0.5"/><translate x="0.5" y="0.5" z="0.5"/></transform>
      <bsdf type="null"/><medium name="interior" type="heterogeneous">
        <volume name="sigma_t" type="gridvolume"><string name="filename" value="{}"/></volume>
        <rgb name="albedo" value="0.9, 0.8, 0.7"/><float name="scale" value="60"/></medium></shape>)",
                                                      path.string()));
  const ByDepth tracked(*scene, FlightMode::tracking), marched(*scene, FlightMode::marching);
  for (int d = 0; d < ByDepth::kDepths; ++d)
    for (const auto& [a, b] :
         {std::pair(tracked.weight[d], marched.weight[d]), {tracked.height[d], marched.height[d]}}) {
      const double error = std::hypot(a.standardError(), b.standardError());
      EXPECT_NEAR(b.mean(), a.mean(), 4.5 * error + 0.01 * a.mean()) << d;
      EXPECT_LT(error, 0.03 * a.mean()) << d << ": too few walks to tell";
    }
}

}  // namespace
}  // namespace virga
