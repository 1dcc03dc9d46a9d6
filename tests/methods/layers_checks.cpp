// SPDX-License-Identifier: Apache-2.0
#include "methods/layers_checks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace virga::testing {

using brute::Grid;
using brute::Material;
using brute::Vector;

Finding compared(const Picture& picture, Layer layer, const Picture& truth, Layer truthLayer) {
  const auto size = static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(truth.size()))));
  Finding finding;
  stats::Moments whole;
  for (int c = 0; c < 3; ++c) {
    stats::Moments parts[5];  // quarters, and all of them
    for (size_t i = 0; i < truth.size(); ++i) {
      const double t = truth[i][static_cast<size_t>(truthLayer)].channel(c);
      const double d = picture[i][static_cast<size_t>(layer)].channel(c) - t;
      parts[(i % size >= size / 2 ? 1 : 0) + (i / size >= size / 2 ? 2 : 0)].add(d);
      parts[4].add(d);
      whole.add(d);
      finding.level += t / static_cast<double>(3 * truth.size());
    }
    for (const stats::Moments& part : parts) finding.p = std::min(finding.p, 15 * stats::oneSampleTest(part, 0));
  }
  // The channels share their paths: they count once.
  finding.precision = finding.level > 0 ? whole.standardError() * std::sqrt(3.0) / finding.level : 0;
  return finding;
}
Finding compared(const Picture& picture, const Picture& truth, Layer layer) {
  return compared(picture, layer, truth, layer);
}

Picture pictureByPath(const std::string& elements, uint64_t seed, int passes) {
  const RenderSession session =
      rendered(sceneOf(elements, ::testing::TempDir()), {.passes = passes, .seed = seed, .layers = LayerMask::all()});
  Picture picture(static_cast<size_t>(session.film().width() * session.film().height()));
  for (size_t l = 0; l < kLayerCount; ++l) {
    const Image image = session.film().layer(static_cast<Layer>(l));
    for (size_t i = 0; i < picture.size(); ++i)
      picture[i][l] = {static_cast<double>(image.pixels[i].r), static_cast<double>(image.pixels[i].g),
                       static_cast<double>(image.pixels[i].b)};
  }
  return picture;
}

std::string elementsOf(const brute::World& world) {
  return brute::sceneElements(world, ::testing::TempDir(),
                              ::testing::UnitTest::GetInstance()->current_test_info()->name());
}

Picture brighter(Picture picture, Layer layer, double factor) {
  for (brute::Layers& pixel : picture) pixel[static_cast<size_t>(layer)] = pixel[static_cast<size_t>(layer)] * factor;
  return picture;
}

void expectAgreement(const Picture& picture, const Picture& truth, const std::vector<Power>& powers, Compare compare) {
  for (size_t l = compare == Compare::all ? 0 : 1; l < kLayerCount; ++l) {
    const Finding f = compared(picture, truth, static_cast<Layer>(l));
    if (f.level > 0)
      fmt::print("{:18} level {:.5f}, standard error {:.2f} %, p {:.2g}\n", kLayerNames[l], f.level, 100 * f.precision,
                 std::min(1.0, f.p));
    EXPECT_GT(f.p, kSuspicious) << kLayerNames[l];
  }
  for (const Power& power : powers) {
    const std::string_view name = kLayerNames[static_cast<size_t>(power.layer)];
    const Finding f = compared(picture, truth, power.layer);
    EXPECT_GT(f.level, 0) << name;
    EXPECT_LT(f.precision, power.precision) << name << ": too few samples to tell";
    const Picture wrong = brighter(picture, power.layer, 1 + kNoticed * power.precision);
    EXPECT_LT(compared(wrong, truth, power.layer).p, kSuspicious) << name << ": the test cannot fail";
  }
}

void expectAgreement(const brute::World& world, const std::vector<Power>& powers, const std::vector<Control>& controls,
                     const Effort& effort) {
  const Picture truth = brute::render(world, effort.samples, 1);
  expectAgreement(pictureByPath(elementsOf(world), 1, effort.passes), truth, powers);
  for (const Control& control : controls) {
    brute::World spoilt = world;
    control.spoil(spoilt);
    const Picture wrong = pictureByPath(elementsOf(spoilt), 2, effort.passes / 3);
    for (const Layer layer : control.layers) {
      const Finding f = compared(wrong, truth, layer);
      fmt::print("control: {}, {} p {:.2g}\n", control.wrong, kLayerNames[static_cast<size_t>(layer)], f.p);
      EXPECT_LT(f.p, kSuspicious) << "the test cannot fail: " << control.wrong;
    }
  }
}

// --- pieces of worlds ---

Material light(double r, double g, double b) { return {.emission = {r, g, b}}; }
Material matt(double r, double g, double b) { return {.diffuse = {r, g, b}}; }

brute::Rectangle floorAt(double y, double half, const Material& m) {
  return {{0, y, 0}, {half, 0, 0}, {0, 0, -half}, m};
}
brute::Rectangle ceilingAt(double y, double half, const Material& m) {
  return {{0, y, 0}, {half, 0, 0}, {0, 0, half}, m};
}

Grid gridOf(int n, const std::function<Vector(double, double, double)>& value) {
  Grid grid{n, {}};
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) grid.values.push_back(value((x + 0.5) / n, (y + 0.5) / n, (z + 0.5) / n));
  return grid;
}

Grid plume() {
  std::mt19937 noise(5);
  return gridOf(16, [&](double x, double y, double z) {
    const double r = std::hypot(x - 0.5 - 0.1 * std::sin(6 * y), z - 0.5) / (0.12 + 0.25 * y);
    const double d = r < 1 ? (1 - r) * (0.3 + 0.7 * static_cast<double>(noise() % 1000) / 1000) : 0;
    return Vector{d, d, d};
  });
}

}  // namespace virga::testing
