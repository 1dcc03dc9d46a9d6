// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "methods/brute_force_math.h"

namespace virga::testing::brute {

/// Where a line meets a surface.
struct Hit {
  double t = kNever;
  Vector normal = {};
  const Material* material = nullptr;
  double u = 0, v = 0;  ///< from 0 to 1 along x and y of a rectangle
};

enum class Outcome {
  absorbed,
  scattered,
  passed,  ///< straight through a pane
};

/// Goes on from a surface: the line becomes that of the scattered light, the throughput what is left of it, and the
/// history gets an 's' or, where the surface is specular, a 'p'.
Outcome reflect(const Hit& hit, Line& line, Vector& throughput, std::string& history, Random& random);

}  // namespace virga::testing::brute
