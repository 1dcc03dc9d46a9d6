// SPDX-License-Identifier: Apache-2.0
#include "core/keyframes.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace virga {
namespace {

using Quaternion = std::array<double, 4>;  // w, x, y, z

Matrix4 linearPart(Matrix4 m) {
  for (int i = 0; i < 3; ++i) m(i, 3) = 0;
  return m;
}

template <class Combine>
Matrix4 combined(const Matrix4& a, const Matrix4& b, const Combine& combine) {
  Matrix4 r;
  for (size_t i = 0; i < 12; ++i) r.m[i] = combine(a.m[i], b.m[i]);
  return r;
}

Matrix4 transposed(const Matrix4& a) {
  Matrix4 r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) r(i, j) = a(j, i);
  return r;
}

double largest(const Matrix4& a) {
  double most = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) most = std::max(most, std::fabs(a(i, j)));
  return most;
}

/// A linear map as a rotation after a stretch. A mirror image is in the stretch.
struct Polar {
  Matrix4 rotation, stretch;
};

// Higham's iteration 1986: the mean of a matrix and its inverse transposed goes to the orthogonal factor.
Polar polarOf(const Matrix4& linear) {
  const double sign = linear.determinant3() < 0 ? -1 : 1, size = largest(linear);
  Matrix4 q = combined(linear, linear, [&](double v, double) { return sign * v / size; });
  constexpr int kMost = 100;
  for (int i = 0; i < kMost; ++i) {
    const Matrix4 next = combined(q, transposed(q.inverse()), [](double a, double b) { return 0.5 * (a + b); });
    const double step = largest(combined(next, q, [](double a, double b) { return a - b; }));
    q = next;
    if (step < 1e-14) break;
  }
  return {q, transposed(q) * linear};
}

// Shepperd 1978: from the largest of the four components.
Quaternion quaternionOf(const Matrix4& r) {
  const double trace = r(0, 0) + r(1, 1) + r(2, 2);
  const double squares[4] = {trace, r(0, 0), r(1, 1), r(2, 2)};
  const auto k = std::max_element(squares, squares + 4) - squares;
  Quaternion q{};
  if (k == 0) {
    q = {1 + trace, r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)};
  } else {
    const int i = static_cast<int>(k) - 1, j = (i + 1) % 3, l = (i + 2) % 3;
    q[0] = r(l, j) - r(j, l);
    q[static_cast<size_t>(i + 1)] = 1 + r(i, i) - r(j, j) - r(l, l);
    q[static_cast<size_t>(j + 1)] = r(i, j) + r(j, i);
    q[static_cast<size_t>(l + 1)] = r(i, l) + r(l, i);
  }
  double norm = 0;
  for (const double c : q) norm += c * c;
  for (double& c : q) c /= std::sqrt(norm);
  return q;
}

Matrix4 rotationOf(const Quaternion& q) {
  const auto [w, x, y, z] = q;
  Matrix4 r;
  r.m = {1 - 2 * (y * y + z * z),
         2 * (x * y - w * z),
         2 * (x * z + w * y),
         0,
         2 * (x * y + w * z),
         1 - 2 * (x * x + z * z),
         2 * (y * z - w * x),
         0,
         2 * (x * z - w * y),
         2 * (y * z + w * x),
         1 - 2 * (x * x + y * y),
         0,
         0,
         0,
         0,
         1};
  return r;
}

Matrix4 slerp(const Matrix4& from, const Matrix4& to, double u) {
  const Quaternion a = quaternionOf(from);
  Quaternion b = quaternionOf(to);
  double cosine = 0;
  for (size_t i = 0; i < 4; ++i) cosine += a[i] * b[i];
  if (cosine < 0)
    for (double& c : b) c = -c;
  const double angle = std::acos(std::min(1.0, std::fabs(cosine))), sine = std::sin(angle);
  const double wa = sine > 1e-9 ? std::sin((1 - u) * angle) / sine : 1 - u;
  const double wb = sine > 1e-9 ? std::sin(u * angle) / sine : u;
  Quaternion q{};
  for (size_t i = 0; i < 4; ++i) q[i] = wa * a[i] + wb * b[i];
  return rotationOf(q);
}

}  // namespace

Matrix4 poseAt(std::span<const Keyframe> keyframes, double time) {
  VIRGA_ASSERT(!keyframes.empty());
  if (time <= keyframes.front().time) return keyframes.front().pose;
  const auto after = std::find_if(keyframes.begin(), keyframes.end(), [&](const Keyframe& k) { return k.time > time; });
  const Keyframe& a = *(after - 1);
  if (after == keyframes.end() || a.time == time || a.pose == after->pose) return a.pose;
  const double u = (time - a.time) / (after->time - a.time);
  const auto mixed = [u](double x, double y) { return (1 - u) * x + u * y; };
  const Polar from = polarOf(linearPart(a.pose)), to = polarOf(linearPart(after->pose));
  Matrix4 pose = slerp(from.rotation, to.rotation, u) * combined(from.stretch, to.stretch, mixed);
  for (int i = 0; i < 3; ++i) pose(i, 3) = mixed(a.pose(i, 3), after->pose(i, 3));
  return pose;
}

}  // namespace virga
