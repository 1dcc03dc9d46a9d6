// SPDX-License-Identifier: Apache-2.0
// Flights that one channel draws for all: weighted, they must follow each channel's own optical depth.
#include "transport/spectral_flight.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stats/stats.h"
#include "transport/emission.h"
#include "transport/fields.h"

namespace virga {
namespace {

using test::Field;
using test::OpticalDepth;
using test::RayPart;

constexpr int kFlights = 60'000;

/// Probability that a flight has ended before `until`, channel by channel, by weighted flights.
std::array<stats::Moments, 3> ended(const MediumView& medium, const RayPart& part, float until, Rgb throughput) {
  Pcg32 random(11);
  std::array<stats::Moments, 3> moments;
  for (int i = 0; i < kFlights; ++i) {
    SpectralFlight flight(throughput, random.next());
    const float t = sampleFreeFlight(medium, part.ray, part.t0, part.t1, random, flight);
    const Rgb weight = flight.weight(throughput);
    for (int c = 0; c < 3; ++c) moments[static_cast<size_t>(c)].add(t <= until ? static_cast<double>(weight[c]) : 0);
  }
  return moments;
}

// A field whose channels have multiples of its density.
void expectChannels(const Field& field, Rgb spectrum, Rgb throughput) {
  MediumView medium = field.medium;
  medium.grey = false;
  medium.spectrum = spectrum;
  for (const RayPart& part : test::raysThrough(field)) {
    const OpticalDepth depth(field, part);
    if (depth.total() < 0.2) continue;
    SCOPED_TRACE(field.name + ", " + part.name);
    const double end = std::isinf(part.t1) ? static_cast<double>(part.t0) + 30 : static_cast<double>(part.t1);
    for (const double share : {0.4, 0.7}) {
      const double until = static_cast<double>(part.t0) + share * (end - static_cast<double>(part.t0));
      const auto found = ended(medium, part, static_cast<float>(until), throughput);
      for (int c = 0; c < 3; ++c) {
        const auto& m = found[static_cast<size_t>(c)];
        const double truth = 1 - std::exp(-static_cast<double>(spectrum[c]) * depth.until(until));
        if (m.variance() == 0) {
          EXPECT_NEAR(m.mean(), truth, 1e-5);
          continue;
        }
        EXPECT_GT(stats::zTest(m.mean(), truth, m.standardError()), 1e-5)
            << "channel " << c << ": " << m.mean() << " for " << truth;
        if (truth > 0.2 && truth < 0.8) {
          const double wrong = 1 - std::exp(-1.15 * static_cast<double>(spectrum[c]) * depth.until(until));
          EXPECT_LT(stats::zTest(m.mean(), wrong, m.standardError()), 1e-3) << "the test cannot fail";
        }
      }
    }
  }
}

TEST(SpectralFlight, FollowsEveryChannel) {
  for (const Field& field : test::fields()) expectChannels(field, {1, 0.5f, 0.1f}, {1, 1, 1});
}

TEST(SpectralFlight, FollowsEveryChannelWhateverTheThroughput) {
  for (const size_t i : {size_t{0}, size_t{3}}) expectChannels(test::fields()[i], {0.3f, 1, 0.5f}, {0.2f, 3, 1});
}

TEST(SpectralFlight, AChannelMayMeetNothing) {
  for (const size_t i : {size_t{0}, size_t{3}}) expectChannels(test::fields()[i], {0, 1, 0.2f}, {1, 1, 1});
}

TEST(SpectralFlight, NeverAddsToTheSumOfTheChannels) {
  Pcg32 random(5);
  MediumView medium = test::fields()[3].medium;
  medium.grey = false;
  medium.spectrum = {1, 0.1f, 0.01f};
  const RayPart part = test::raysThrough(test::fields()[3])[0];
  for (int i = 0; i < 20'000; ++i) {
    const Rgb throughput(random.next(), random.next() < 0.3f ? 0 : random.next(), 2 * random.next());
    SpectralFlight flight(throughput, random.next());
    sampleFreeFlight(medium, part.ray, part.t0, part.t1, random, flight);
    const Rgb after = throughput * flight.weight(throughput);
    ASSERT_TRUE(isFinite(after));
    ASSERT_NEAR(after.r + after.g + after.b, throughput.r + throughput.g + throughput.b, 1e-5);
    ASSERT_GT(throughput[flight.hero], 0);
  }
}

TEST(SpectralFlight, SurvivesExtremes) {
  SpectralFlight flight({1, 1, 1}, 0.5f);
  ASSERT_EQ(flight.hero, 1);
  flight.note({100, 1, 0}, 1000, 2000);  // more than floats could hold: 100^1000 exp(-198000)
  const Rgb weight = flight.weight({1, 1, 1});
  EXPECT_EQ(weight.r, 0);
  EXPECT_NEAR(weight.g, 3, 1e-5);
  EXPECT_EQ(weight.b, 0);
  SpectralFlight still({1, 1, 1}, 0.1f);
  still.note({1, 1, 2}, 0, kInfinity);
  EXPECT_NEAR(still.weight({1, 1, 1}).r, 1.5f, 1e-6f);
  EXPECT_EQ(still.weight({1, 1, 1}).b, 0);
}

/// A density of three channels on 6^3 voxels, the medium, and the optical depth by midpoints in double precision.
struct Colors {
  RgbGrid colors;
  std::shared_ptr<const Grid> bound;
  MediumView medium;

  Colors() : colors(6, 6, 6, values()), bound(colors.largestChannel()) {
    medium.sigmaT = 2;
    medium.spectrum = {1, 0.5f, 1};
    medium.grey = medium.homogeneous = false;
    medium.density = bound->view();
    medium.densityColors = colors.view();
    medium.worldToDensity = Affine(bound->indexToWorld().inverse());
  }
  static std::vector<Rgb> values() {
    Pcg32 random(77);
    std::vector<Rgb> v;
    for (int i = 0; i < 216; ++i) v.emplace_back(3 * random.next(), i % 5 == 0 ? 0 : random.next(), 0.4f);
    return v;
  }
  std::array<double, 3> depth(const Ray& ray, float t0, float t1) const {
    std::array<double, 3> sum{};
    constexpr int kSteps = 20'000;
    for (int i = 0; i < kSteps; ++i) {
      const Rgb s = medium.sigmaTAt(ray.at(lerp(t0, t1, (static_cast<float>(i) + 0.5f) / kSteps)));
      for (int c = 0; c < 3; ++c) sum[static_cast<size_t>(c)] += static_cast<double>(s[c] * (t1 - t0)) / kSteps;
    }
    return sum;
  }
};

TEST(SpectralFlight, FollowsGridsOfColours) {
  const Colors world;
  const RayPart part{"slanted", {{-0.2f, 0.1f, 0.3f}, normalize(Vec3(1, 0.5f, 0.3f))}, 0, 3};
  for (const float until : {0.5f, 0.8f, 2.f}) {
    const auto depth = world.depth(part.ray, 0, until);
    const auto found = ended(world.medium, part, until, {1, 1, 1});
    for (size_t c = 0; c < 3; ++c) {
      const double truth = 1 - std::exp(-depth[c]), wrong = 1 - std::exp(-1.1 * depth[c]);
      EXPECT_GT(stats::zTest(found[c].mean(), truth, found[c].standardError()), 1e-5) << c << " at " << until;
      if (depth[c] > 0.3) {
        EXPECT_LT(stats::zTest(found[c].mean(), wrong, found[c].standardError()), 1e-4) << "the test cannot fail";
      }
    }
  }
}

TEST(Transmittance, OfEveryChannelIsUnbiased) {
  const Colors world;
  const Ray ray{{-0.2f, 0.1f, 0.3f}, normalize(Vec3(1, 0.5f, 0.3f))};
  const auto depth = world.depth(ray, 0, 3);
  std::array<stats::Moments, 3> found;
  Pcg32 random(12);
  for (int i = 0; i < 200'000; ++i) {
    const Rgb t = estimateTransmittance(world.medium, ray, 0, 3, random);
    for (int c = 0; c < 3; ++c) found[static_cast<size_t>(c)].add(static_cast<double>(t[c]));
  }
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_GT(stats::zTest(found[c].mean(), std::exp(-depth[c]), found[c].standardError()), 1e-5) << c;
    EXPECT_LT(stats::zTest(found[c].mean(), std::exp(-1.05 * depth[c]), found[c].standardError()), 1e-4) << c;
  }
}

TEST(Emission, OfAGridIsUnbiased) {
  const Colors world;
  MediumView medium;
  medium.emits = true, medium.glowsEvenly = false;
  medium.emission = {1, 2, 3};
  medium.emissionGrid = world.bound->view();
  medium.emissionColors = world.colors.view();
  medium.worldToEmission = world.medium.worldToDensity;
  const Ray ray{{-0.2f, 0.1f, 0.3f}, normalize(Vec3(1, 0.5f, 0.3f))};
  const auto depth = world.depth(ray, 0, 3);  // of 2 {1, 0.5, 1} times the same colours
  std::array<stats::Moments, 3> found;
  Pcg32 random(12);
  for (int i = 0; i < 50'000; ++i) {
    const Rgb e = estimateEmission(medium, ray, 0, 3, random);
    for (int c = 0; c < 3; ++c) found[static_cast<size_t>(c)].add(static_cast<double>(e[c]));
  }
  const double factors[] = {0.5, 2, 1.5};
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(found[c].mean(), factors[c] * depth[c], std::max(4 * found[c].standardError(), 3e-4 * found[c].mean()))
        << c;
    EXPECT_LT(found[c].standardError(), 5e-3 * found[c].mean());
  }
}

}  // namespace
}  // namespace virga
