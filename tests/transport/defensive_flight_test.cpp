// SPDX-License-Identifier: Apache-2.0
// Optical depths without noise, and flights whose density is a number.
#include "transport/defensive_flight.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stats/stats.h"
#include "transport/fields.h"
#include "transport/optical_depth.h"

namespace virga {
namespace {

using test::Field;
using test::RayPart;

TEST(OpticalDepthOfMedia, IsExact) {
  int compared = 0;
  for (const Field& field : test::fields())
    for (const RayPart& part : test::raysThrough(field)) {
      const double expected = std::exp(-test::OpticalDepth(field, part).total());
      const Rgb found = exp(opticalDepth(field.medium, part.ray, part.t0, part.t1) * -1.f);
      EXPECT_NEAR(found.g, expected, 2e-5) << field.name << ", " << part.name;
      compared += expected < 0.9 && expected > 0.01 ? 1 : 0;
    }
  EXPECT_GT(compared, 20);
}

TEST(OpticalDepthOfMedia, IsFoundTheOtherWayRound) {
  int compared = 0;
  for (const Field& field : test::fields())
    for (const RayPart& part : test::raysThrough(field)) {
      const test::OpticalDepth exact(field, part);
      for (const double share : {0.01, 0.4, 0.99, 1.01}) {
        const double depth = share * exact.total();
        if (!(depth > 1e-4) || std::isinf(depth)) continue;
        const float t = distanceOfDepth(field.medium, 1, static_cast<float>(depth), part.ray, part.t0, part.t1);
        SCOPED_TRACE(field.name + ", " + part.name);
        EXPECT_EQ(std::isinf(t), share > 1);
        if (share > 1) continue;
        EXPECT_NEAR(std::exp(-exact.until(static_cast<double>(t))), std::exp(-depth), 1e-3);
        ++compared;
      }
    }
  EXPECT_GT(compared, 60);
}

TEST(OpticalDepthOfMedia, HasAColour) {
  const Ray ray{{0, 0, 0}, {0, 0, 1}};
  MediumView medium;
  medium.sigmaT = 2, medium.spectrum = {1, 0.5f, 0}, medium.grey = false;
  EXPECT_EQ(opticalDepth(medium, ray, 1, 2), Rgb(2, 1, 0));
  EXPECT_EQ(exp(opticalDepth(medium, ray, 1, kInfinity) * -1.f), Rgb(0, 0, 1));
  medium.sigmaT = 0;
  EXPECT_EQ(opticalDepth(medium, ray, 0, kInfinity), Rgb(0, 0, 0));
}

struct Flown {
  stats::Moments arrivals, collisions, places;
  int arrived = 0;
};

/// Over their densities, flights that arrive count 1, collisions the length of the part, and their distances its
/// square, halved: wherever the medium is.
Flown fly(const Field& field, const RayPart& part, float t1, DefensiveFlight::Walk walk, float wrong = 1) {
  SceneView scene;
  scene.media = {&field.medium, 1};
  // The majorants stand for means that are spread: any other numbers of the same cells.
  const DefensiveRates rates{1 / (t1 - part.t0), 0.3f * field.medium.sigmaT, 0.4f * field.medium.sigmaT,
                             field.medium.density.majorant};
  MediaRay r{part.ray, {}, 0};
  r.media.setBase(0);
  Pcg32 random(7);
  Flown flown;
  for (int i = 0; i < 20'000; ++i) {
    DefensiveFlight flight(scene, {&rates, 1}, walk, random);
    float covered = part.t0;
    const Collision c = flight.fly(r, part.t0, t1, random, [&](const MediaPiece& p) { covered = p.t1; });
    EXPECT_EQ(covered, c.found() ? c.t : t1);
    const FlightDensity density = c.found() ? flight.collision(0) : flight.survival();
    const float own = walk == DefensiveFlight::Walk::own ? density.own : density.wary;
    const double weight = 1 / static_cast<double>(c.found() ? wrong * own : own);
    flown.arrived += c.found() ? 0 : 1;
    flown.arrivals.add(c.found() ? 0 : weight);
    flown.collisions.add(c.found() ? weight : 0);
    flown.places.add(c.found() ? weight * static_cast<double>(c.t - part.t0) : 0);
  }
  return flown;
}

TEST(DefensiveFlight, FindsEveryPlaceWithTheDensityThatItTells) {
  for (const Field& field : test::fields()) {
    const RayPart part = test::raysThrough(field).front();
    const float t1 = std::isinf(part.t1) ? part.t0 + 4 : part.t1;
    const double length = static_cast<double>(t1) - static_cast<double>(part.t0);
    const Flown flown = fly(field, part, t1, DefensiveFlight::Walk::wary);
    SCOPED_TRACE(field.name + ", " + part.name);
    EXPECT_GT(stats::oneSampleTest(flown.arrivals, 1), 1e-4);
    EXPECT_GT(stats::oneSampleTest(flown.collisions, length), 1e-4);
    EXPECT_GT(stats::oneSampleTest(flown.places, 0.5 * length * length), 1e-4);
    EXPECT_LT(stats::oneSampleTest(fly(field, part, t1, DefensiveFlight::Walk::wary, 1.1f).collisions, length), 1e-4)
        << "the test cannot fail";
  }
}

// By sigma_t alone as many flights arrive as the medium lets through, and over their density these count 1.
TEST(DefensiveFlight, FindsWhatTheMediumIsByItsOwnDensity) {
  for (const Field& field : test::fields()) {
    const RayPart part = test::raysThrough(field).front();
    const float t1 = std::isinf(part.t1) ? part.t0 + 4 : part.t1;
    const double through = std::exp(-test::OpticalDepth(field, part).until(static_cast<double>(t1)));
    const Flown flown = fly(field, part, t1, DefensiveFlight::Walk::own);
    SCOPED_TRACE(field.name + ", " + part.name);
    EXPECT_NEAR(static_cast<double>(flown.arrived) / 20'000, through, 0.02);
    if (through > 0.05) {
      EXPECT_GT(stats::oneSampleTest(flown.arrivals, 1), 1e-4);
    }
  }
}

// Shares of both kinds of walks: over the density of the mixture, those of either kind together count 1.
TEST(WalkDensity, IsThatOfAMixture) {
  WalkDensity walk;
  const FlightDensity flights[] = {{2, 0.5f}, {0.1f, 0.3f}, {3, 3}};
  float own = WalkDensity::kOwnWalks, wary = 1 - own, inverse = 1;
  for (const FlightDensity& f : flights) {
    own *= f.own, wary *= f.wary, inverse *= walk.inverse(f);
    EXPECT_NEAR(inverse * (own + wary), 1, 1e-5f);
  }
  EXPECT_EQ(walk.inverse({0, 0}), 0);
}

}  // namespace
}  // namespace virga
