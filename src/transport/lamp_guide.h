// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene_view.h"

namespace virga {

/// A point on a lamp, drawn at a vertex of an eye path for its next segment. In fog around the lamp a ray gathers light
/// as 1 / the distance at which it passes the point: a share of the directions is drawn so that those that pass near
/// are common, the others by phase function or bsdf, and all are weighted by the mixture of both densities.
struct LampGuide {
  static constexpr float kMostShare = 0.5f;  ///< measured: docs/decisions/guided-directions.md

  int emitter = -1;  ///< -1: none was drawn
  float choice = 0;  ///< probability of the emitter...
  Vec3 lampsFor;     ///< ...for the light at this place
  Vec2 place;        ///< what draws a point on it
  LightPoint on;     ///< that point, of a lamp at a finite distance, whoever looks at it
  float share = 0;   ///< of the directions that are guided
  float even = 1;    ///< density of even directions [1/sr]
  Vec3 axis;         ///< unit, toward the point; 0 where nothing is to be guided

  VIRGA_HD bool drawn() const { return emitter >= 0; }
  VIRGA_HD bool hasAxis() const { return lengthSquared(axis) > 0; }
  /// Fewer are guided where few go along the axis by themselves: `pdf` is the density there, `evenPdf` that of even
  /// directions.
  VIRGA_HD void guide(float pdf, float evenPdf) { even = evenPdf, share = kMostShare * std::fmin(1.f, pdf / even); }

  /// Density 1 / (8 pi sin(theta / 2)), theta the angle to the axis: sin(theta / 2) is uniform. Directions are mirrored
  /// to the side of `normal`; 0 in a medium.
  VIRGA_HD Vec3 sample(Vec3 normal, Vec2 u) const {
    const float s = 2 * u.x * std::sqrt(1 - u.x * u.x), phi = kTwoPi * u.y;
    const Vec3 w = Frame(axis).toWorld({s * std::cos(phi), s * std::sin(phi), 1 - 2 * u.x * u.x});
    return dot(w, normal) < 0 ? mirrored(w, normal) : w;
  }
  /// [1/sr]
  VIRGA_HD float pdf(Vec3 normal, Vec3 w) const {
    if (lengthSquared(normal) == 0) return density(w);
    return dot(w, normal) > 0 ? density(w) + density(mirrored(w, normal)) : 0;
  }
  /// Density of all directions, those by phase function or bsdf having `own` [1/sr].
  VIRGA_HD float mixture(float own, Vec3 normal, Vec3 w) const {
    return share > 0 ? lerp(own, pdf(normal, w), share) : own;
  }
  /// How much more light than others a ray this way is expected to gather.
  VIRGA_HD float promise(Vec3 normal, Vec3 w) const { return share > 0 ? lerp(1.f, pdf(normal, w) / even, share) : 1; }

 private:
  VIRGA_HD static Vec3 mirrored(Vec3 w, Vec3 normal) { return w - normal * (2 * dot(w, normal)); }
  VIRGA_HD float density(Vec3 w) const { return 1 / (4 * kPi * length(w - axis)); }
};

}  // namespace virga
