// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene_view.h"

namespace virga {

/// Part of a ray in one homogeneous medium, where scattering points can be drawn in proportion to the inverse squared
/// distance to a light (Kulla and Fajardo 2012) instead of by free flight. Before it the ray meets no medium.
struct EquiangularSegment {
  /// Lights of less area than this, in squared mean free paths, are small: near them, connections from free flights
  /// have a variance that is infinite (points) or nearly so. For larger ones hits by chance bound it.
  static constexpr float kSmallLight = 0.01f;
  /// Optical depth below which the distance to a light says more about where to scatter than the transmittance does.
  static constexpr float kThin = 4;

  int medium = -1;           ///< -1: there is none
  bool largeLights = false;  ///< to be aimed at, too
  Ray ray;
  Vec3 lampsFor = {};    ///< the place for whose light a lamp to aim at is chosen
  float t0 = 0, t1 = 0;  ///< t1 may be infinite
  float sigmaT = 0;      ///< [1/unit] of the densest channel
  bool grey = true;
  Rgb spectrum{1, 1, 1};  ///< of sigma_t, relative to sigmaT
  Rgb choice{1, 0, 0};    ///< probability with which each channel draws the free flight

  VIRGA_HD bool active() const { return medium >= 0; }
  VIRGA_HD bool contains(float t) const { return active() && t >= t0 && t <= t1; }

  VIRGA_HD bool aimsAt(const EmitterView& e) const {
    return active() && e.isLocal() && (largeLights || e.area * square(sigmaT) < kSmallLight || replacesFlights(e));
  }
  /// So much better than free flights that these need not be connected to the light at all: it lies in the same fog,
  /// which is thin along this segment.
  VIRGA_HD bool replacesFlights(const EmitterView& e) const {
    return active() && e.medium == medium && sigmaT * (t1 - t0) < kThin;
  }

  /// sigma_t tau(t0, t): density of a flight of each channel that ends at t [1/unit].
  VIRGA_HD Rgb flight(float t) const {
    const float depth = sigmaT * (t - t0);
    return grey ? Rgb(sigmaT * std::exp(-depth)) : spectrum * exp(spectrum * -depth) * sigmaT;
  }
  /// Density with which a path's flight ends at t [1/unit].
  VIRGA_HD float freeFlightPdf(float t) const {
    const Rgb f = flight(t);
    return grey ? f.r : choice.r * f.r + choice.g * f.g + choice.b * f.b;
  }

  struct Sample {
    float t, pdf;  ///< pdf in [1/unit]; 0: no sample
  };
  /// t = t_y + D tan(theta), theta uniform between the ends; D the distance from y to the line.
  VIRGA_HD Sample sample(Vec3 y, float u) const {
    const Angles a(*this, y);
    const float t = clamp(t0 + a.distance(u), t0, t1);
    return {t, a.pdf(t - a.foot)};
  }
  VIRGA_HD float pdf(Vec3 y, float t) const {
    const Angles a(*this, y);
    return a.pdf(t - a.foot);
  }

 private:
  /// The segment as seen from y. From afar its ends are at nearly the same angle: their difference is never formed.
  struct Angles {
    float foot, height;  ///< of y: along the ray, and beside it
    float start;         ///< of the segment, from the foot
    float range;         ///< angle that the segment fills [rad]

    VIRGA_HD Angles(const EquiangularSegment& s, Vec3 y) {
      const Vec3 toLight = y - s.ray.o;
      foot = dot(toLight, s.ray.d);
      // A light on the ray would leave no width to sample; the floor keeps the density finite and exact for what is
      // drawn.
      height = std::max(length(toLight - s.ray.d * foot), 1e-4f * std::max(std::fabs(foot), 1e-12f));
      start = s.t0 - foot;
      // atan(b) - atan(a) = atan2(b - a, 1 + a b)
      range = std::isinf(s.t1) ? std::atan2(height, start)
                               : std::atan2(height * (s.t1 - s.t0), height * height + start * (s.t1 - foot));
    }
    /// From the segment's start to the point at the share u of the angle: tan(a + b) - tan(a), over one denominator.
    VIRGA_HD float distance(float u) const {
      const float s = std::sin(u * range), c = std::cos(u * range);
      const float denominator = height * c - start * s;
      return denominator > 0 ? s * (height * height + start * start) / denominator : kInfinity;
    }
    VIRGA_HD float pdf(float x) const { return range > 0 ? height / (range * (height * height + x * x)) : 0; }
  };
};

}  // namespace virga
