// SPDX-License-Identifier: Apache-2.0
#include "methods/layers_checks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

#include "image/scratch.h"

namespace virga::testing {

using brute::Grid;
using brute::Material;
using brute::Vector;

namespace {

double mean(Vector v) { return (v.x + v.y + v.z) / 3; }

bool asksFor(const std::vector<Power>& powers, size_t layer) {
  return std::any_of(powers.begin(), powers.end(),
                     [=](const Power& power) { return static_cast<size_t>(power.layer) == layer; });
}

}  // namespace

double thoroughness() {
  const char* text = std::getenv("VIRGA_LAYER_EFFORT");
  return text ? std::stod(text) : 1;
}

int thorough(int count) { return static_cast<int>(std::lround(count * thoroughness())); }

Finding compared(const Picture& picture, Layer layer, const Picture& truth, Layer truthLayer) {
  const auto size = static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(truth.size()))));
  stats::Moments parts[4][5];  // of the channels and their mean: quarters, and all of them
  Finding finding;
  for (size_t i = 0; i < truth.size(); ++i) {
    const size_t quarter = (i % size >= size / 2 ? 1u : 0u) + (i / size >= size / 2 ? 2u : 0u);
    const Vector t = truth[i][static_cast<size_t>(truthLayer)], d = picture[i][static_cast<size_t>(layer)] - t;
    for (const size_t part : {quarter, size_t{4}}) {
      for (int c = 0; c < 3; ++c) parts[c][part].add(d.channel(c));
      parts[3][part].add(mean(d));
    }
    finding.level += mean(t) / static_cast<double>(truth.size());
  }
  for (const auto& channel : parts)
    for (const stats::Moments& part : channel) finding.p = std::min(finding.p, 20 * stats::oneSampleTest(part, 0));
  if (finding.level > 0) {
    finding.difference = parts[3][4].mean() / finding.level;
    finding.precision = parts[3][4].standardError() / finding.level;
  }
  return finding;
}
Finding compared(const Picture& picture, const Picture& truth, Layer layer) {
  return compared(picture, layer, truth, layer);
}

Picture pictureByPath(const std::string& elements, uint64_t seed, int passes) {
  const RenderSession session =
      rendered(sceneOf(elements), {.passes = passes, .seed = seed, .layers = LayerMask::all()});
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
  return brute::sceneElements(world, scratchFile("").string(), "world");
}

Picture brighter(Picture picture, Layer layer, double factor) {
  for (brute::Layers& pixel : picture) pixel[static_cast<size_t>(layer)] = pixel[static_cast<size_t>(layer)] * factor;
  return picture;
}

void expectAgreement(const Picture& picture, const Picture& truth, const std::vector<Power>& powers, Compare compare) {
  for (size_t l = compare == Compare::all ? 0 : 1; l < kLayerCount; ++l) {
    const Finding f = compared(picture, truth, static_cast<Layer>(l));
    EXPECT_GT(f.p, kSuspicious) << kLayerNames[l];
    if (f.level == 0) continue;
    fmt::print("{:18} level {:.5f}, off by {:+.3f} +- {:.3f} %, p {:.2g}\n", kLayerNames[l], f.level,
               100 * f.difference, 100 * f.precision, std::min(1.0, f.p));
    EXPECT_TRUE(asksFor(powers, l)) << kLayerNames[l] << " carries light: to what precision?";
  }
  for (const Power& power : powers) {
    const std::string_view name = kLayerNames[static_cast<size_t>(power.layer)];
    const Finding f = compared(picture, truth, power.layer);
    EXPECT_GT(f.level, 0) << name;
    EXPECT_LE(power.precision, kCoarsest) << name;
    const double precision = power.precision / std::sqrt(thoroughness());
    EXPECT_LT(f.precision, precision) << name << ": too few samples to tell";
    const Picture wrong = brighter(picture, power.layer, 1 + kNoticed * precision);
    EXPECT_LT(compared(wrong, truth, power.layer).p, kSuspicious) << name << ": the test cannot fail";
  }
}

void expectAgreement(const brute::World& world, const std::vector<Power>& powers, const std::vector<Control>& controls,
                     const Effort& effort) {
  const Picture truth = brute::render(world, thorough(effort.samples), 1);
  expectAgreement(pictureByPath(elementsOf(world), 1, thorough(effort.passes)), truth, powers);
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
