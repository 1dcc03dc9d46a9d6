// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/vec.h"
#include "core/warp.h"

namespace virga {

// Phase functions. wo and wi point away from the scattering point, so light that goes straight on has dot(wo, wi) = -1.

struct PhaseSample {
  Vec3 wi;
  float value;  ///< [1/sr]
  float pdf;    ///< [1/sr]
};

/// Uniform over the sphere.
struct Isotropic {
  VIRGA_HD float value(Vec3, Vec3) const { return kInv4Pi; }
  VIRGA_HD float pdf(Vec3, Vec3) const { return kInv4Pi; }
  VIRGA_HD PhaseSample sample(Vec3, Vec2 u) const { return {uniformSphere(u), kInv4Pi, kInv4Pi}; }
};

/// Henyey and Greenstein 1941, g in (-1, 1). Sampling is exact: value() is also the density.
struct HenyeyGreenstein {
  float g;

  VIRGA_HD float value(Vec3 wo, Vec3 wi) const {
    // Half the squared distance of unit vectors is 1 - cos(angle), and keeps its digits where 1 + dot(wo, wi) is
    // rounding error.
    return atHeight(0.5f * lengthSquared(g < 0 ? wi - wo : wi + wo));
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const { return value(wo, wi); }
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    // The textbook inverse with its 1/g cancelled by hand, so that g -> 0 is no special case.
    const float a = std::fabs(g);
    const float r = (1 - a) / (1 - a + 2 * a * u.x);
    const float v = 2 * (1 - u.x) * r * r * (1 + a * u.x);
    const float sinTheta = std::sqrt(std::max(0.f, v * (2 - v)));
    const Vec3 wi = Frame(g < 0 ? wo : -wo).toWorld(sphericalDirection(sinTheta, 1 - v, kTwoPi * u.y));
    const float p = atHeight(v);
    return {wi, p, p};
  }

 private:
  // v = 1 - cos(angle to the peak). The peak lies ahead for g > 0 and behind for g < 0, of the same shape: taken from
  // the peak, 1 + g^2 - 2 g cos(theta) = (1 - |g|)^2 + 2 |g| v does not cancel for either sign.
  VIRGA_HD float atHeight(float v) const {
    const float a = std::fabs(g), d = square(1 - a) + 2 * a * v;
    return kInv4Pi * (1 - a * a) / (d * std::sqrt(d));
  }
};

/// Cornette and Shanks 1992: Henyey-Greenstein times (1 + c^2), normalised; g = 0 is Rayleigh's function. Sampled as
/// Henyey-Greenstein, so value / pdf = 1.5 (1 + c^2) / (2 + g^2) <= 1.5.
struct CornetteShanks {
  float g;

  VIRGA_HD float ratio(float c) const { return 1.5f * (1 + c * c) / (2 + g * g); }
  VIRGA_HD float value(Vec3 wo, Vec3 wi) const { return HenyeyGreenstein{g}.value(wo, wi) * ratio(dot(wo, wi)); }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const { return HenyeyGreenstein{g}.value(wo, wi); }
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    PhaseSample s = HenyeyGreenstein{g}.sample(wo, u);
    s.value *= ratio(dot(wo, s.wi));
    return s;
  }
};

/// Any of the above, as a tagged value. A new phase function is a struct with value, pdf and sample, a Kind, and a line
/// here.
class PhaseFunction {
 public:
  enum class Kind : uint8_t { isotropic, henyeyGreenstein, cornetteShanks };

  /// Calls f with the phase function that this is.
  template <class F>
  VIRGA_HD auto visit(F&& f) const {
    switch (kind_) {
      case Kind::henyeyGreenstein:
        return f(HenyeyGreenstein{g_});
      case Kind::cornetteShanks:
        return f(CornetteShanks{g_});
      default:
        return f(Isotropic{});
    }
  }

  PhaseFunction() = default;
  VIRGA_HD explicit PhaseFunction(Isotropic) {}
  VIRGA_HD explicit PhaseFunction(HenyeyGreenstein p) : kind_(Kind::henyeyGreenstein), g_(p.g) {}
  VIRGA_HD explicit PhaseFunction(CornetteShanks p) : kind_(Kind::cornetteShanks), g_(p.g) {}

  VIRGA_HD Kind kind() const { return kind_; }
  VIRGA_HD float g() const { return g_; }
  VIRGA_HD float value(Vec3 wo, Vec3 wi) const {
    return visit([&](auto p) { return p.value(wo, wi); });
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    return visit([&](auto p) { return p.pdf(wo, wi); });
  }
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    return visit([&](auto p) { return p.sample(wo, u); });
  }
  friend bool operator==(const PhaseFunction&, const PhaseFunction&) = default;

 private:
  Kind kind_ = Kind::isotropic;
  float g_ = 0;
};

}  // namespace virga
