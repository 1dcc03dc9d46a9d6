// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "methods/brute_force.h"
#include "methods/rendering.h"

/// Layer by layer against an independent estimator. Pixels of both are independent, so their differences are, too:
/// t-tests of the mean difference over the picture and its quarters, of each channel and of their mean.
namespace virga::testing {

using Picture = std::vector<brute::Layers>;

/// A p-value below this is a disagreement.
inline constexpr double kSuspicious = 2e-4;

/// How many passes the renderer makes, and how many paths a pixel the brute-force tracer follows.
struct Effort {
  int passes = 640, samples = 3000;
};

/// The environment's VIRGA_LAYER_EFFORT: how many times as many passes and samples are made, by whose root all
/// precisions that are asked for shrink; 1 if it is not set. bench/layers.py sets it.
double thoroughness();
/// So many, times that.
int thorough(int count);

/// What two pictures say about one layer.
struct Finding {
  double p = 1;           ///< of the worst of twenty tests, times twenty
  double level = 0;       ///< mean over the picture
  double difference = 0;  ///< of the means, relative to the level
  double precision = 0;   ///< its standard error
};

Finding compared(const Picture& picture, Layer layer, const Picture& truth, Layer truthLayer);
Finding compared(const Picture& picture, const Picture& truth, Layer layer);

Picture pictureByPath(const std::string& elements, uint64_t seed = 1, int passes = thorough(Effort{}.passes));
/// The world in a scene file; its grids are in files that the next world overwrites.
std::string elementsOf(const brute::World& world);

inline constexpr double kNoticed = 7;

/// The coarsest precision that may be asked for.
inline constexpr double kCoarsest = 0.02;

/// A layer that is to be there, and to what precision it is compared (with a thoroughness of 1): kNoticed times that,
/// over all of the picture, is seen to be noticed.
struct Power {
  Layer layer;
  double precision;
};

/// A world of which one parameter is wrong, and layers in each of which the same test has to notice.
struct Control {
  const char* wrong;
  std::vector<Layer> layers;
  std::function<void(brute::World&)> spoil;
};

/// The same picture with one layer times a factor.
Picture brighter(Picture picture, Layer layer, double factor);

enum class Compare { all, notEmission };

/// All layers agree, and each that carries light is in the list of powers.
void expectAgreement(const Picture& picture, const Picture& truth, const std::vector<Power>& powers,
                     Compare compare = Compare::all);
void expectAgreement(const brute::World& world, const std::vector<Power>& powers,
                     const std::vector<Control>& controls = {}, const Effort& effort = {});

// --- pieces of worlds ---

brute::Material light(double r, double g, double b);
brute::Material matt(double r, double g, double b);
brute::Rectangle floorAt(double y, double half, const brute::Material& m);
brute::Rectangle ceilingAt(double y, double half, const brute::Material& m);

/// Values at the centres of n^3 voxels, whose coordinates go from 0 to 1.
brute::Grid gridOf(int n, const std::function<brute::Vector(double, double, double)>& value);
/// A column that widens and frays as it rises; empty in the corners, densest where a noise says.
brute::Grid plume();

}  // namespace virga::testing
