// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "methods/layers_checks.h"

/// Layer by layer against `path`, by independent replicates: pixels of one pass share its virtual lights, so that only
/// whole pictures are independent of each other.
namespace virga::testing {

/// Smoke on a grid in a room that lamps on the ceiling light. [1/unit]
SceneSnapshot smokyRoom(const brute::Grid& density, double sigmaT, brute::Vector albedo = {0.95, 0.9, 0.8});

/// How much is computed: `sets` sessions of kReplicates replicates each, with `passes` passes a replicate.
struct Trials {
  int sets = 20;
  int passes = 1;
  uint64_t seed = 1;
};

/// Means over the picture's quarters and over all of it, channel by channel, one for each replicate.
class Estimates {
 public:
  static constexpr int kRegions = 5, kChannels = 3;

  void add(const Film& film, int replicate);
  void add(const Estimates& other);  ///< as if they had been made together

  const stats::Moments& at(size_t layer, int region, int channel) const {
    return moments_[layer][static_cast<size_t>(region)][static_cast<size_t>(channel)];
  }
  double value(size_t layer, int region, int channel, size_t replicate) const {
    return values_.of[layer][region][channel][replicate];
  }
  double level(size_t layer) const;  ///< mean over the picture and the channels
  uint64_t nonFinite = 0;
  /// The same with one layer times a factor.
  Estimates scaled(Layer layer, double factor) const;

 private:
  struct Values {
    std::vector<double> of[kLayerCount][kRegions][kChannels];
  };
  void update();

  Values values_;
  stats::Moments moments_[kLayerCount][kRegions][kChannels];
};

Estimates estimates(const SceneSnapshot& scene, const std::string& method, const SettingValues& settings,
                    const Trials& trials);

/// What Welch's test says about two estimates of one layer.
struct Difference {
  double p = 1;          ///< of the worst of fifteen tests (regions, channels), times fifteen
  double level = 0;      ///< of the second one, the truth
  double precision = 0;  ///< standard error of the difference over all of the picture, relative to the level
  double relative = 0;   ///< the difference itself, likewise
};
Difference differenceOf(const Estimates& a, const Estimates& truth, size_t layer);

/// A layer's p-value below this is a disagreement. Some thousand layers are compared: by chance that would happen to
/// one in fifty sets of seeds.
inline constexpr double kDisagree = 2e-5;

/// Every layer of `a` agrees with the truth; nothing is not finite.
void expectSame(const Estimates& a, const Estimates& truth, const std::string& name);
/// Each of these layers is there, is compared to its precision, and would be seen to be wrong by kNoticed times that.
void expectPower(const Estimates& a, const Estimates& truth, const std::vector<Power>& powers, const std::string& name);

/// The grid of settings over which `ims` is held against `path`.
struct SettingsGrid {
  std::vector<double> radii = {0.1, 0.25, 0.5, 1};
  std::vector<std::string> compensations = {"path", "sampled"};
  SettingValues others = {{"walks", "1024"}};
};

/// All settings of the grid against `path`, each by itself, and all together, which tells finer. `powers` is what all
/// together have to reach.
void expectImsIsPath(const std::string& elements, const std::vector<Power>& powers, const Trials& trials = {},
                     const SettingsGrid& grid = {});

}  // namespace virga::testing
