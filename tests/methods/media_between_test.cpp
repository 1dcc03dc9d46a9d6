// SPDX-License-Identifier: Apache-2.0
// Tables of what a frame's media let through: media that lie far apart have some each.
#include "methods/instant_scattering/media_between.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "methods/rendering.h"
#include "transport/optical_depth.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

using namespace virga::testing;

/// Balls of fog, of one colour or of three, in a row.
SceneSnapshot balls(std::initializer_list<double> places, const std::string& sigmaT) {
  std::string elements =
      fmt::format(R"(<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="{}"/></medium>)", sigmaT);
  for (const double x : places)
    elements += fmt::format(R"(<shape type="sphere"><float name="radius" value="0.5"/>
      <point name="center" x="{}" y="0" z="0"/><bsdf type="null"/><ref id="fog" name="interior"/></shape>)",
                            x);
  return sceneOf(elements + R"(<sensor type="perspective"/>)");
}

Rgb exactly(const Scene& scene, Vec3 from, Vec3 to) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const float d = distance(from, to);
  return exp(opticalDepth(scene.view, rays, {{from, (to - from) / d}, mediaAt(scene, from), 0}, d) * -1);
}

/// Root mean square of what transmittances to places in and behind the first ball are off by, in one channel.
double errorFrom(const Scene& scene, Vec3 p, const MediaBetween& between, int channel) {
  constexpr int kPlaces = 512;
  std::vector<float> x, y, z;
  Pcg32 random(7);
  for (int n = 0; n < kPlaces; ++n) {
    x.push_back(random.next() * 2 - 1), y.push_back(random.next() * 2 - 1), z.push_back(random.next() * 2 - 1);
  }
  std::vector<float> values[3] = {std::vector<float>(kPlaces), std::vector<float>(kPlaces),
                                  std::vector<float>(kPlaces)};
  float* seen[3] = {values[0].data(), values[1].data(), values[2].data()};
  const KernelReceivers to{kPlaces, x.data(), y.data(), z.data(), nullptr, nullptr,
                           nullptr, nullptr,  nullptr,  nullptr,  nullptr};
  between.look(0, to, seen);
  double sum = 0;
  for (size_t n = 0; n < kPlaces; ++n) {
    const Rgb truth = exactly(scene, p, {x[n], y[n], z[n]});
    sum += std::pow(static_cast<double>(seen[channel][n] - truth[channel]), 2) / kPlaces;
  }
  return std::sqrt(sum);
}

TEST(MediaBetween, PartsFarApartAreSeenAsSharplyAsOneAlone) {
  const Vec3 p(3, 4, 1);
  for (const char* sigmaT : {"3", "1, 3, 6"}) {
    const SceneSnapshot near = balls({0}, sigmaT), far = balls({0, 20}, sigmaT);
    const MediaBetween alone(*near, {p}, {}, {}), parts(*far, {p}, {}, {}), together(*far, {p}, {.parts = 1}, {});
    EXPECT_EQ(alone.parts(), 1u);
    ASSERT_EQ(parts.parts(), 2u);
    ASSERT_EQ(together.parts(), 1u);
    for (int c = 0; c < 3; ++c) {
      const double usual = errorFrom(*near, p, alone, c);
      EXPECT_LT(errorFrom(*far, p, parts, c), 1.5 * usual) << c;
      EXPECT_GT(errorFrom(*far, p, together, c), 2 * usual) << "the test cannot fail";
    }
  }
}

// From within one of them, through both.
TEST(MediaBetween, WhatPartsLetThroughMultiplies) {
  const SceneSnapshot scene = balls({0, 3}, "1");
  const Vec3 p(3, 0, 0);
  const MediaBetween between(*scene, {p}, {.side = 64, .radii = 96}, {});
  ASSERT_EQ(between.parts(), 2u);
  const float x = -2, zero = 0;
  float value[3] = {1, 1, 1};
  float* seen[3] = {&value[0], &value[1], &value[2]};
  between.look(0, {1, &x, &zero, &zero, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr}, seen);
  EXPECT_NEAR(seen[0][0], std::exp(-1.5f), 0.005f);
}

}  // namespace
}  // namespace virga
