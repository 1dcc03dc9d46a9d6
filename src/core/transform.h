// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "core/vec.h"

namespace virga {

/// 4x4 matrix in double precision, row-major, applied to column vectors. Scene set-up only.
struct Matrix4 {
  std::array<double, 16> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

  double operator()(int row, int column) const { return m[static_cast<size_t>(4 * row + column)]; }
  double& operator()(int row, int column) { return m[static_cast<size_t>(4 * row + column)]; }
  friend bool operator==(const Matrix4&, const Matrix4&) = default;

  static Matrix4 translation(double x, double y, double z);
  static Matrix4 scaling(double x, double y, double z);
  /// Right-handed rotation by `degrees` about `axis` (any non-zero length).
  static Matrix4 rotation(double x, double y, double z, double degrees);
  /// Camera to world: +z looks from origin to target, +y is up, +x points left (Mitsuba's convention).
  static Matrix4 lookAt(const std::array<double, 3>& origin, const std::array<double, 3>& target,
                        const std::array<double, 3>& up);

  double determinant3() const;  ///< of the upper left 3x3 block
  bool isFinite() const;
  bool isAffine() const;  ///< last row is 0 0 0 1
  /// Singular when the linear part maps the unit cube to less than 1e-12 of the cube of its longest edge.
  bool isSingular() const;
  Matrix4 inverse() const;  ///< of an affine, regular matrix
};

Matrix4 operator*(const Matrix4& a, const Matrix4& b);

/// Affine map in single precision, as kernels use it.
struct Affine {
  Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, translation;  ///< images of the axes and of the origin

  Affine() = default;
  explicit Affine(const Matrix4& m);

  VIRGA_HD Vec3 point(Vec3 p) const { return x * p.x + y * p.y + z * p.z + translation; }
  VIRGA_HD Vec3 vector(Vec3 v) const { return x * v.x + y * v.y + z * v.z; }
  /// Product with the transpose of the linear part: maps normals if this is the *inverse* of the points' map.
  VIRGA_HD Vec3 transposed(Vec3 n) const { return {dot(x, n), dot(y, n), dot(z, n)}; }
  /// Throws nothing, but is of no use where the map is singular.
  Affine inverse() const;
  friend bool operator==(const Affine&, const Affine&) = default;
};

}  // namespace virga
