// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "scene/medium.h"
#include "volume/grid.h"

namespace virga::test {

using Triple = std::array<double, 3>;

/// A medium together with what its density is, said a second time and in double precision.
struct Field {
  std::string name;
  MediumView medium;
  Matrix4 indexToWorld;
  std::function<double(const Triple&)> density;  ///< at index coordinates
  Triple lo{}, hi{};                             ///< of the support, index coordinates
  bool exactBorders = false;  ///< index coordinates are world coordinates: rays on the support's faces are well defined
  std::shared_ptr<const Grid> grid;
  std::vector<float> majorants;

  double sigmaT() const { return static_cast<double>(medium.sigmaT); }
};

/// Every kind of medium: homogeneous, dense (one value; lumps; with holes), sparse, with a background, with majorants
/// that the density meets exactly, turned and stretched.
const std::vector<Field>& fields();

/// A part of a ray, in world coordinates.
struct RayPart {
  std::string name;
  Ray ray;
  float t0 = 0, t1 = kInfinity;
};

/// Through, along, beside and away from a field's support; from outside and from within.
std::vector<RayPart> raysThrough(const Field& field);

/// Optical depth along a ray, exact up to rounding: between planes of voxel centres the density is a cubic polynomial
/// of t.
class OpticalDepth {
 public:
  OpticalDepth(const Field& field, const RayPart& part);

  double until(double t) const;  ///< from the part's start; t within it
  double total() const { return total_; }

 private:
  double densityAt(double t) const;
  double piece(double a, double b) const;

  const Field* field_;
  Triple o_{}, d_{};
  std::vector<double> knots_, sums_;
  double last_ = 0, total_ = 0;
};

}  // namespace virga::test
