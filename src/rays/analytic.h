// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>

#include "core/transform.h"
#include "core/vec.h"

// Shapes that a line meets by a formula, for RayShape.
namespace virga::analytic {

struct Sphere {
  Vec3 center;
  float radius;
};
struct Disk {
  Vec3 center, normal;
  float radius;
};
struct Cylinder {
  Vec3 end, axis;
  float radius, length;
};
struct Box {
  Affine toLocal;
};
using Shape = std::variant<std::monostate, Sphere, Disk, Cylinder, Box>;

/// One point where a line meets an analytic shape.
struct LineHit {
  float t;
  bool entering;
};
struct LineHits {
  LineHit hit[2];
  int count = 0;
};

// In double precision: far away, the discriminant of a small sphere cancels in float.
inline LineHits intersect(const Sphere& s, Vec3 o, Vec3 d) {
  const double ox = double{o.x} - double{s.center.x}, oy = double{o.y} - double{s.center.y},
               oz = double{o.z} - double{s.center.z};
  const double dx = d.x, dy = d.y, dz = d.z;
  const double a = dx * dx + dy * dy + dz * dz;
  const double b = ox * dx + oy * dy + oz * dz;
  // Squared distance from the centre to the line, without the cancellation of b^2 - a c.
  const double px = ox - b / a * dx, py = oy - b / a * dy, pz = oz - b / a * dz;
  const double r2 = double{s.radius} * double{s.radius};
  const double discriminant = a * (r2 - (px * px + py * py + pz * pz));
  if (!(discriminant > 0)) return {};
  const double root = std::sqrt(discriminant);
  return {{{static_cast<float>((-b - root) / a), true}, {static_cast<float>((-b + root) / a), false}}, 2};
}

inline LineHits intersect(const Disk& k, Vec3 o, Vec3 d) {
  const float along = dot(k.normal, d);
  if (along == 0) return {};
  const float t = dot(k.normal, k.center - o) / along;
  if (!(lengthSquared(o + d * t - k.center) <= k.radius * k.radius)) return {};
  return {{{t, along < 0}, {}}, 1};
}

// In double precision, for the same reason as the sphere: in the plane across the axis, a circle.
inline LineHits intersect(const Cylinder& c, Vec3 o, Vec3 d) {
  const double axis[] = {double{c.axis.x}, double{c.axis.y}, double{c.axis.z}};
  const double from[] = {double{o.x} - double{c.end.x}, double{o.y} - double{c.end.y}, double{o.z} - double{c.end.z}};
  const double to[] = {double{d.x}, double{d.y}, double{d.z}};
  const auto inner = [](const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const double unit = inner(axis, axis), height = inner(from, axis) / unit, climb = inner(to, axis) / unit;
  double p[3], q[3];
  for (int i = 0; i < 3; ++i) p[i] = from[i] - height * axis[i], q[i] = to[i] - climb * axis[i];
  const double a = inner(q, q), b = inner(p, q);
  if (!(a > 0)) return {};
  double nearest[3];
  for (int i = 0; i < 3; ++i) nearest[i] = p[i] - b / a * q[i];
  const double discriminant = a * (double{c.radius} * double{c.radius} - inner(nearest, nearest));
  if (!(discriminant > 0)) return {};
  const double root = std::sqrt(discriminant);
  LineHits hits;
  for (const double side : {-1.0, 1.0}) {
    const double t = (-b + side * root) / a, z = height + t * climb;
    if (z >= 0 && z <= double{c.length}) hits.hit[hits.count++] = {static_cast<float>(t), side < 0};
  }
  return hits;
}

inline LineHits intersect(const Box& box, Vec3 o, Vec3 d) {
  const Vec3 lo = box.toLocal.point(o), ld = box.toLocal.vector(d);
  float tEnter = -kInfinity, tLeave = kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = 1 / ld[axis];
    const float t0 = (-1 - lo[axis]) * inverse, t1 = (1 - lo[axis]) * inverse;
    if (ld[axis] == 0) {
      if (std::fabs(lo[axis]) >= 1) return {};
      continue;
    }
    tEnter = std::max(tEnter, std::min(t0, t1));
    tLeave = std::min(tLeave, std::max(t0, t1));
  }
  if (!(tEnter < tLeave)) return {};
  return {{{tEnter, true}, {tLeave, false}}, 2};
}

inline Bounds boundsOf(const Sphere& s) { return {s.center - Vec3(s.radius), s.center + Vec3(s.radius)}; }

inline Bounds boundsOf(const Disk& k) {
  const auto half = [&](float n) { return k.radius * std::sqrt(std::max(0.f, 1 - n * n)); };
  const Vec3 h(half(k.normal.x), half(k.normal.y), half(k.normal.z));
  return {k.center - h, k.center + h};
}

inline Bounds boundsOf(const Cylinder& c) {
  Bounds b = boundsOf(Disk{c.end, c.axis, c.radius});
  b.extend(boundsOf(Disk{c.end + c.axis * c.length, c.axis, c.radius}));
  return b;
}

}  // namespace virga::analytic
