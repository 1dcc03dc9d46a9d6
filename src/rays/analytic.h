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

inline float lowerDistance(const Bounds& b, Vec3 p) { return length(max(max(b.lo - p, p - b.hi), Vec3(0))); }

// Lower bounds of the distance to a shape: exact for spheres and disks.
inline float lowerDistance(const Sphere& s, Vec3 p) { return std::fabs(distance(p, s.center) - s.radius); }
inline float lowerDistance(const Disk& k, Vec3 p) {
  const Vec3 q = p - k.center;
  const float height = dot(q, k.normal), beside = length(q - k.normal * height);
  return std::hypot(height, std::max(0.f, beside - k.radius));
}
inline float lowerDistance(const Cylinder& c, Vec3 p) { return lowerDistance(boundsOf(c), p); }

// Largest coordinate along a unit direction.
inline float farthestAlong(const Sphere& s, Vec3 n) { return dot(n, s.center) + s.radius; }
inline float farthestAlong(const Disk& k, Vec3 n) {
  return dot(n, k.center) + k.radius * std::sqrt(std::max(0.f, 1 - square(dot(n, k.normal))));
}
inline float farthestAlong(const Cylinder& c, Vec3 n) {
  return std::max(farthestAlong(Disk{c.end, c.axis, c.radius}, n),
                  farthestAlong(Disk{c.end + c.axis * c.length, c.axis, c.radius}, n));
}

/// Distance from p to a triangle. By the region of its plane that p lies over (Ericson, Real-Time Collision Detection,
/// 5.1.5).
inline float distanceToTriangle(Vec3 p, Vec3 a, Vec3 b, Vec3 c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return length(ap);
  const float d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return length(bp);
  const float d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return length(cp);
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return distance(p, a + ab * (d1 / (d1 - d3)));
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return distance(p, a + ac * (d2 / (d2 - d6)));
  const float va = d3 * d6 - d5 * d4, alongB = d4 - d3, alongC = d5 - d6;
  if (va <= 0 && alongB >= 0 && alongC >= 0) return distance(p, b + (c - b) * (alongB / (alongB + alongC)));
  return distance(p, a + (ab * vb + ac * vc) / (va + vb + vc));
}

}  // namespace virga::analytic
