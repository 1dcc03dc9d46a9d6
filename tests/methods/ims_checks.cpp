// SPDX-License-Identifier: Apache-2.0
#include "methods/ims_checks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "image/scratch.h"

namespace virga::testing {
namespace {

/// Mean of a region (0 to 3: quarters, 4: all) of a channel.
double regionMean(const Image& image, int region, int channel) {
  double sum = 0;
  int64_t count = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const int quarter = (2 * x >= image.width ? 1 : 0) + (2 * y >= image.height ? 2 : 0);
      if (region < 4 && quarter != region) continue;
      sum += static_cast<double>(image.pixels[static_cast<size_t>(y * image.width + x)][channel]);
      ++count;
    }
  return sum / static_cast<double>(count);
}

/// Where not even a whole picture's mean is known to this, a few bright samples make a quarter's, which is nothing for
/// a t-test.
constexpr double kTailed = 0.05;

/// Bonferroni's bound.
constexpr double kTests = Estimates::kRegions * Estimates::kChannels;

}  // namespace

SceneSnapshot smokyRoom(const brute::Grid& density, double sigmaT, brute::Vector albedo) {
  brute::World w;
  w.eye = {0.5, 0.2, 3.6};
  w.fieldOfView = 35;
  w.size = 16;
  w.maxDepth = 6;
  w.rectangles = {floorAt(-1, 2, matt(0.6, 0.5, 0.4)), {{0, 0, -1.2}, {2, 0, 0}, {0, 2, 0}, matt(0.3, 0.5, 0.7)}};
  // In frames lamps of more than eight points have small tables.
  constexpr int kLamps = 3;
  for (int i = 0; i < kLamps; ++i)
    w.rectangles.push_back({{0, 1.2, (2. * i + 1) / kLamps - 1}, {1, 0, 0}, {0, 0, 1. / kLamps}, light(4, 3.5, 3)});
  brute::Region box{.form = brute::Region::Form::box, .lo = {-0.8, -1, -0.9}, .hi = {0.9, 1.1, 0.8}, .medium = {}};
  box.medium.sigmaT = sigmaT, box.medium.albedo = albedo, box.medium.density = density;
  w.regions.push_back(box);
  const ScratchFolder folder;
  return sceneOf(brute::sceneElements(w, folder.path().string(), "smoke"), folder.path().string());
}

void Estimates::add(const Film& film, int replicate) {
  for (size_t l = 0; l < kLayerCount; ++l) {
    const Image image = film.replicateLayer(replicate, static_cast<Layer>(l));
    for (int r = 0; r < kRegions; ++r)
      for (int c = 0; c < kChannels; ++c) values_.of[l][r][c].push_back(regionMean(image, r, c));
  }
  update();
}

void Estimates::add(const Estimates& other) {
  for (size_t l = 0; l < kLayerCount; ++l)
    for (int r = 0; r < kRegions; ++r)
      for (int c = 0; c < kChannels; ++c) {
        const auto& more = other.values_.of[l][r][c];
        values_.of[l][r][c].insert(values_.of[l][r][c].end(), more.begin(), more.end());
      }
  nonFinite += other.nonFinite;
  update();
}

void Estimates::update() {
  for (size_t l = 0; l < kLayerCount; ++l)
    for (int r = 0; r < kRegions; ++r)
      for (int c = 0; c < kChannels; ++c) moments_[l][r][c] = stats::Moments(values_.of[l][r][c]);
}

double Estimates::level(size_t layer) const {
  double sum = 0;
  for (int c = 0; c < kChannels; ++c) sum += at(layer, 4, c).mean() / kChannels;
  return sum;
}

Estimates Estimates::scaled(Layer layer, double factor) const {
  Estimates result = *this;
  for (auto& region : result.values_.of[static_cast<size_t>(layer)])
    for (auto& channel : region)
      for (double& v : channel) v *= factor;
  result.update();
  return result;
}

Estimates estimates(const SceneSnapshot& scene, const std::string& method, const SettingValues& given,
                    const Trials& trials) {
  SettingValues settings = given;
  // As many lights in every scene, whatever the default: the precision of the tests was found with them.
  if (method == "ims") settings.insert({"lights", "4"});
  Estimates result;
  for (int s = 0; s < trials.sets; ++s) {
    const RenderSession session = rendered(scene, {.passes = Film::kReplicates * trials.passes,
                                                   .seed = trials.seed * 1000 + static_cast<uint64_t>(s),
                                                   .layers = LayerMask::all(),
                                                   .method = method,
                                                   .settings = settings});
    result.nonFinite += session.film().nonFiniteSamples();
    for (int r = 0; r < Film::kReplicates; ++r) result.add(session.film(), r);
  }
  return result;
}

Difference differenceOf(const Estimates& a, const Estimates& truth, size_t layer) {
  Difference d;
  d.level = truth.level(layer);
  double variance = 0;
  // The channels share their paths: they count once.
  for (int c = 0; c < Estimates::kChannels; ++c)
    variance +=
        (std::pow(a.at(layer, 4, c).standardError(), 2) + std::pow(truth.at(layer, 4, c).standardError(), 2)) / 3;
  if (d.level > 0) d.precision = std::sqrt(variance) / d.level, d.relative = a.level(layer) / d.level - 1;
  for (int c = 0; c < Estimates::kChannels; ++c)
    for (int r = d.precision > kTailed ? 4 : 0; r < Estimates::kRegions; ++r)
      d.p = std::min(d.p, kTests * stats::welchTest(a.at(layer, r, c), truth.at(layer, r, c)));
  return d;
}

void expectSame(const Estimates& a, const Estimates& truth, const std::string& name) {
  EXPECT_EQ(a.nonFinite, 0u) << name;
  std::string line;
  for (size_t l = 0; l < kLayerCount; ++l) {
    const Difference d = differenceOf(a, truth, l);
    EXPECT_GT(d.p, kDisagree) << name << ": " << kLayerNames[l] << " differs by " << 100 * d.relative << " %, +- "
                              << 100 * d.precision << " %";
    if (d.level > 0) line += fmt::format(" {:+.1f}/{:.1f}", 100 * d.relative, 100 * d.precision);
  }
  fmt::print("{:32}{} %\n", name, line);
}

void expectPower(const Estimates& a, const Estimates& truth, const std::vector<Power>& powers,
                 const std::string& name) {
  for (const Power& power : powers) {
    const auto layer = static_cast<size_t>(power.layer);
    const Difference d = differenceOf(a, truth, layer);
    EXPECT_GT(d.level, 0) << name << ": " << kLayerNames[layer];
    EXPECT_LT(d.precision, power.precision) << name << ": " << kLayerNames[layer] << ": too few samples to tell";
    const Estimates wrong = a.scaled(power.layer, 1 + kNoticed * power.precision);
    EXPECT_LT(differenceOf(wrong, truth, layer).p, kDisagree)
        << name << ": " << kLayerNames[layer] << ": the test cannot fail";
  }
}

void expectImsIsPath(const std::string& elements, const std::vector<Power>& powers, const Trials& trials,
                     const SettingsGrid& grid) {
  const SceneSnapshot scene = sceneOf(elements);
  const Estimates truth =
      estimates(scene, "path", {}, {.sets = 3 * trials.sets, .passes = trials.passes, .seed = trials.seed});
  Estimates all;
  uint64_t seed = trials.seed;
  for (const std::string& compensation : grid.compensations)
    for (const double radius : grid.radii) {
      SettingValues settings = grid.others;
      settings["compensation"] = compensation;
      settings["radius"] = fmt::format("{}", radius);
      const Estimates found =
          estimates(scene, "ims", settings, {.sets = trials.sets, .passes = trials.passes, .seed = ++seed});
      expectSame(found, truth, fmt::format("{}, radius {}", compensation, radius));
      all.add(found);
    }
  expectSame(all, truth, "all together");
  expectPower(all, truth, powers, "all together");
}

}  // namespace virga::testing
