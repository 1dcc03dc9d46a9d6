// SPDX-License-Identifier: Apache-2.0
#include "core/transform.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"

namespace virga {
namespace {

using Triple = std::array<double, 3>;

Triple difference(const Triple& a, const Triple& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Triple crossProduct(const Triple& a, const Triple& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double norm(const Triple& a) { return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); }
Triple unit(const Triple& a) {
  const double n = norm(a);
  return {a[0] / n, a[1] / n, a[2] / n};
}

}  // namespace

Matrix4 Matrix4::translation(double x, double y, double z) {
  Matrix4 r;
  r(0, 3) = x, r(1, 3) = y, r(2, 3) = z;
  return r;
}

Matrix4 Matrix4::scaling(double x, double y, double z) {
  Matrix4 r;
  r(0, 0) = x, r(1, 1) = y, r(2, 2) = z;
  return r;
}

Matrix4 Matrix4::rotation(double x, double y, double z, double degrees) {
  const Triple a = unit({x, y, z});
  const double angle = degrees * (3.14159265358979323846 / 180), c = std::cos(angle), s = std::sin(angle);
  Matrix4 r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      r(i, j) = (1 - c) * a[static_cast<size_t>(i)] * a[static_cast<size_t>(j)] + (i == j ? c : 0);
  r(0, 1) -= s * a[2], r(0, 2) += s * a[1];
  r(1, 0) += s * a[2], r(1, 2) -= s * a[0];
  r(2, 0) -= s * a[1], r(2, 1) += s * a[0];
  return r;
}

Matrix4 Matrix4::lookAt(const Triple& origin, const Triple& target, const Triple& up) {
  const Triple forward = unit(difference(target, origin));
  const Triple left = unit(crossProduct(up, forward));
  const Triple newUp = crossProduct(forward, left);
  Matrix4 r;
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<size_t>(i);
    r(i, 0) = left[k], r(i, 1) = newUp[k], r(i, 2) = forward[k], r(i, 3) = origin[k];
  }
  return r;
}

double Matrix4::determinant3() const {
  const Matrix4& a = *this;
  return a(0, 0) * (a(1, 1) * a(2, 2) - a(1, 2) * a(2, 1)) - a(0, 1) * (a(1, 0) * a(2, 2) - a(1, 2) * a(2, 0)) +
         a(0, 2) * (a(1, 0) * a(2, 1) - a(1, 1) * a(2, 0));
}

bool Matrix4::isFinite() const {
  return std::all_of(m.begin(), m.end(), [](double v) { return std::isfinite(v); });
}

bool Matrix4::isAffine() const { return m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1; }

bool Matrix4::isSingular() const {
  // By the angles between its columns, and by their lengths: a long thin box is no flat one.
  constexpr double kFlat = 1e-12;
  double volume = 1, shortest = std::numeric_limits<double>::infinity(), longest = 0;
  for (int j = 0; j < 3; ++j) {
    const double column = norm({(*this)(0, j), (*this)(1, j), (*this)(2, j)});
    volume *= column;
    shortest = std::min(shortest, column), longest = std::max(longest, column);
  }
  return !(std::fabs(determinant3()) > kFlat * volume && shortest > kFlat * longest);
}

Matrix4 Matrix4::inverse() const {
  VIRGA_ASSERT(isAffine());
  const Matrix4& a = *this;
  const double d = 1 / determinant3();
  Matrix4 r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (j + 1) % 3, i2 = (j + 2) % 3, j1 = (i + 1) % 3, j2 = (i + 2) % 3;
      r(i, j) = (a(i1, j1) * a(i2, j2) - a(i1, j2) * a(i2, j1)) * d;
    }
  for (int i = 0; i < 3; ++i) r(i, 3) = -(r(i, 0) * a(0, 3) + r(i, 1) * a(1, 3) + r(i, 2) * a(2, 3));
  return r;
}

Matrix4 operator*(const Matrix4& a, const Matrix4& b) {
  Matrix4 r;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      double sum = 0;
      for (int k = 0; k < 4; ++k) sum += a(i, k) * b(k, j);
      r(i, j) = sum;
    }
  return r;
}

Affine::Affine(const Matrix4& m) {
  const auto column = [&](int j) {
    return Vec3(static_cast<float>(m(0, j)), static_cast<float>(m(1, j)), static_cast<float>(m(2, j)));
  };
  x = column(0), y = column(1), z = column(2), translation = column(3);
}

Affine Affine::inverse() const {
  Matrix4 m;
  const Vec3 columns[4] = {x, y, z, translation};
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) m(row, column) = static_cast<double>(columns[column][row]);
  return Affine(m.inverse());
}

}  // namespace virga
