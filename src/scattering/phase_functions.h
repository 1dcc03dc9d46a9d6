// SPDX-License-Identifier: Apache-2.0
#pragma once

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
  friend bool operator==(const Isotropic&, const Isotropic&) = default;
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
  friend bool operator==(const HenyeyGreenstein&, const HenyeyGreenstein&) = default;

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
  friend bool operator==(const CornetteShanks&, const CornetteShanks&) = default;
};

/// Rayleigh's function of small particles, 3 (1 + c^2) / (16 pi). Sampling is exact.
struct Rayleigh {
  VIRGA_HD float value(Vec3 wo, Vec3 wi) const { return atCosine(dot(wo, wi)); }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const { return value(wo, wi); }
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    // The distribution of c is inverted by Cardano's formula for c^3 + 3 c = 2 z. Its two roots are inverse to each
    // other, and only the one above 1 is formed without cancellation.
    const float z = 4 * u.x - 2, a = std::fabs(z);
    const float root = std::cbrt(a + std::sqrt(a * a + 1));
    const float c = std::copysign(std::min(root - 1 / root, 1.f), z);
    const Vec3 wi = Frame(-wo).toWorld(sphericalDirection(std::sqrt(std::max(0.f, 1 - c * c)), c, kTwoPi * u.y));
    const float p = atCosine(c);
    return {wi, p, p};
  }
  friend bool operator==(const Rayleigh&, const Rayleigh&) = default;

 private:
  VIRGA_HD static float atCosine(float c) { return 0.75f * kInv4Pi * (1 + c * c); }
};

/// Blasi, Le Saec and Schlick 1993: (1 - k^2) / (4 pi (1 - k c)^2), k in (-1, 1), positive forward. Sampling is exact.
struct Schlick {
  float k;

  /// The k that comes near to Henyey-Greenstein of mean cosine g. It leaves (-1, 1) at |g| = 0.938.
  VIRGA_HD static float likeHenyeyGreenstein(float g) { return (1.55f - 0.55f * g * g) * g; }

  VIRGA_HD float value(Vec3 wo, Vec3 wi) const { return atHeight(0.5f * lengthSquared(k < 0 ? wi - wo : wi + wo)); }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const { return value(wo, wi); }
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    const float a = std::fabs(k);
    const float v = 2 * (1 - a) * (1 - u.x) / (1 - a + 2 * a * u.x);
    const float sinTheta = std::sqrt(std::max(0.f, v * (2 - v)));
    const Vec3 wi = Frame(k < 0 ? wo : -wo).toWorld(sphericalDirection(sinTheta, 1 - v, kTwoPi * u.y));
    const float p = atHeight(v);
    return {wi, p, p};
  }
  friend bool operator==(const Schlick&, const Schlick&) = default;

 private:
  // v = 1 - cos(angle to the peak), as for Henyey and Greenstein: 1 - k c = (1 - |k|) + |k| v.
  VIRGA_HD float atHeight(float v) const {
    const float a = std::fabs(k);
    return kInv4Pi * (1 - a) * (1 + a) / square(1 - a + a * v);
  }
};

}  // namespace virga
