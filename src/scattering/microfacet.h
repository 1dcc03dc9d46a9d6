// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/rgb.h"
#include "core/vec.h"
#include "core/warp.h"
#include "scattering/bsdf_sample.h"
#include "scattering/fresnel.h"

namespace virga {

/// Slopes of a rough surface's facets, by the square root of twice their variance along x and y. Facets shadow each
/// other as Smith's separable term has it (Walter et al. 2007). Normals m have m.z > 0.
struct Microfacet {
  enum class Kind : uint8_t { beckmann, ggx };
  /// The normals that samples are drawn from: those that are seen from wo, or all of them.
  enum class Sampling : uint8_t { visible, all };

  Kind kind = Kind::beckmann;
  Sampling sampling = Sampling::visible;
  float alphaX = 0.1f, alphaY = 0.1f;

  /// Density of normals [1/sr]; its integral times m.z is 1.
  VIRGA_HD float density(Vec3 m) const {
    if (m.z <= 0) return 0;
    const float x = m.x / (alphaX * m.z), y = m.y / (alphaY * m.z), z2 = m.z * m.z;
    const float slope2 = x * x + y * y, peak = kInvPi / (alphaX * alphaY * z2 * z2);
    return kind == Kind::beckmann ? peak * std::exp(-slope2) : peak / square(1 + slope2);
  }

  /// The part of the facets facing w that is not in another's shadow (Smith's G1; the same for w and -w).
  VIRGA_HD float unshadowed(Vec3 w) const {
    const float across2 = square(alphaX * w.x) + square(alphaY * w.y);
    if (kind == Kind::ggx) return 2 / (1 + std::sqrt(1 + across2 / (w.z * w.z)));
    if (across2 <= 0) return 1;
    const float a = std::fabs(w.z) / std::sqrt(across2);
    if (a <= 0) return 0;
    return 2 / (1 + std::erf(a) + std::exp(-a * a) / (a * kSqrtPi));
  }

  /// Density [1/sr] with which sampleNormal picks m; wo.z > 0.
  VIRGA_HD float pdf(Vec3 wo, Vec3 m) const {
    if (sampling == Sampling::all) return density(m) * m.z;
    return unshadowed(wo) * std::max(0.f, dot(wo, m)) * density(m) / wo.z;
  }

  /// A normal, for wo.z > 0; may face away from wo where all are drawn from.
  VIRGA_HD Vec3 sampleNormal(Vec3 wo, Vec2 u) const {
    // Stretched by alpha, the facets are those of alpha = 1.
    const Vec3 seen = sampling == Sampling::all ? Vec3(0, 0, 1) : normalize({alphaX * wo.x, alphaY * wo.y, wo.z});
    const Vec3 m = kind == Kind::beckmann ? beckmannNormal(seen, u) : ggxNormal(seen, u);
    return normalize({alphaX * m.x, alphaY * m.y, m.z});
  }

  /// What is left of density * unshadowed(wo) * unshadowed(wi) * |dot(wo, m)| / |wo.z| after division by pdf(wo, m):
  /// the weight of a sample, before Fresnel's share.
  VIRGA_HD float weight(Vec3 wo, Vec3 wi, Vec3 m) const {
    if (sampling == Sampling::visible) return unshadowed(wi);
    return unshadowed(wo) * unshadowed(wi) * std::fabs(dot(wo, m) / (wo.z * m.z));
  }

 private:
  static constexpr float kSqrtPi = 1.77245385090551602730f;

  // Uniform on the part of the unit sphere's reflections that fall to z > 0 (Dupuy and Benyoub 2023).
  VIRGA_HD static Vec3 ggxNormal(Vec3 seen, Vec2 u) {
    const float z = (1 - u.x) * (1 + seen.z) - seen.z;
    const float sine = std::sqrt(clamp((1 - z) * (1 + z), 0, 1));
    return sphericalDirection(sine, z, kTwoPi * u.y) + seen;
  }

  // Slopes along and across the direction: the first weighted by how much of the facet is seen, the second normal.
  VIRGA_HD static Vec3 beckmannNormal(Vec3 seen, Vec2 u) {
    const float sine = std::sqrt(seen.x * seen.x + seen.y * seen.y);
    const Vec2 along = sine > 0 ? Vec2{seen.x / sine, seen.y / sine} : Vec2{1, 0};
    const float x = visibleSlope(seen.z, sine, u.x), y = visibleSlope(1, 0, u.y);
    return {along.x * x - along.y * y, along.y * x + along.x * y, 1};
  }

  // Inverts F(x), in proportion to the integral of (cosTheta + t sinTheta) exp(-t^2) over the slopes t < x that face
  // the direction, by Newton's method kept inside a bracket.
  VIRGA_HD static float visibleSlope(float cosTheta, float sinTheta, float u) {
    constexpr float kSteepest = 4;  // erf(4) rounds to 1
    const float least = sinTheta > 0 ? std::max(-cosTheta / sinTheta, -float{kSteepest}) : -float{kSteepest};
    const auto integral = [=](float x) {
      return 0.5f * (cosTheta * std::erf(x) - sinTheta / kSqrtPi * std::exp(-x * x));
    };
    const float start = integral(least), target = start + u * (integral(kSteepest) - start);
    float lo = least, hi = kSteepest, x = std::max(0.f, lo);
    for (int i = 0; i < 16; ++i) {
      const float error = integral(x) - target;
      (error > 0 ? hi : lo) = x;
      const float slope = (cosTheta + x * sinTheta) / kSqrtPi * std::exp(-x * x);
      const float next = slope > 0 ? x - error / slope : lo;
      const float kept = next > lo && next < hi ? next : 0.5f * (lo + hi);
      if (std::fabs(kept - x) <= 1e-6f * (1 + std::fabs(x))) return kept;
      x = kept;
    }
    return x;
  }
};

/// Rough metal, one-sided (Walter et al. 2007; Cook and Torrance 1982). eta + i k relative to the outside.
struct RoughConductor {
  static constexpr int kColors = 3;
  Microfacet facets;
  Rgb eta, k, reflectance;

  VIRGA_HD Rgb& color(int i) { return i == 0 ? eta : (i == 1 ? k : reflectance); }
  VIRGA_HD Rgb value(Vec3 wo, Vec3 wi) const {
    if (wo.z <= 0 || wi.z <= 0) return {};
    const Vec3 m = normalize(wo + wi);
    const float share = facets.density(m) * facets.unshadowed(wo) * facets.unshadowed(wi) / (4 * wo.z * wi.z);
    return reflected(dot(wo, m)) * share;
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    if (wo.z <= 0 || wi.z <= 0) return 0;
    const Vec3 m = normalize(wo + wi);
    return facets.pdf(wo, m) / (4 * dot(wo, m));
  }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2 u, float) const {
    if (wo.z <= 0) return {};
    const Vec3 m = facets.sampleNormal(wo, u);
    const float c = dot(wo, m);
    const Vec3 wi = m * (2 * c) - wo;
    if (c <= 0 || wi.z <= 0) return {};
    return {wi, reflected(c) * facets.weight(wo, wi, m), facets.pdf(wo, m) / (4 * c), false, 1};
  }

 private:
  VIRGA_HD Rgb reflected(float cosine) const { return reflectance * fresnelConductor(std::min(cosine, 1.f), eta, k); }
};

/// Rough interface between two dielectrics of different indices; the normal points outside (Walter et al. 2007).
/// Refracted radiance scales with the square of the relative index, as that of Dielectric does.
struct RoughDielectric {
  static constexpr int kColors = 2;
  Microfacet facets;
  float eta;  ///< inside over outside index; not 1, for which nothing would be rough
  Rgb reflectance, transmittance;

  VIRGA_HD Rgb& color(int i) { return i == 0 ? reflectance : transmittance; }
  VIRGA_HD Rgb value(Vec3 wo, Vec3 wi) const {
    const Facet f = facetBetween(wo, wi);
    if (!f.found) return {};
    const float fresnel = fresnelDielectric(f.cosO, eta).reflectance;
    const float share = facets.density(f.m) * facets.unshadowed(wo) * facets.unshadowed(wi) / std::fabs(wo.z * wi.z);
    if (wo.z * wi.z > 0) return reflectance * (0.25f * fresnel * share);
    return transmittance * ((1 - fresnel) * share * std::fabs(f.cosO) * f.perNormal / square(relativeIndex(wo)));
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    const Facet f = facetBetween(wo, wi);
    if (!f.found) return 0;
    const float fresnel = fresnelDielectric(f.cosO, eta).reflectance;
    return facets.pdf(upper(wo), f.m) * f.perNormal * (wo.z * wi.z > 0 ? fresnel : 1 - fresnel);
  }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2 u, float choice) const {
    if (wo.z == 0) return {};
    const Vec3 m = facets.sampleNormal(upper(wo), u);
    const float cosO = dot(wo, m);
    if (cosO * wo.z <= 0) return {};
    const DielectricFresnel f = fresnelDielectric(cosO, eta);
    const float p = facets.pdf(upper(wo), m);
    if (choice < f.reflectance) {
      const Vec3 wi = m * (2 * cosO) - wo;
      if (wi.z * wo.z <= 0) return {};
      return {wi, reflectance * facets.weight(wo, wi, m), p * f.reflectance / (4 * std::fabs(cosO)), false, 1};
    }
    const float cosI = cosO > 0 ? -f.cosTransmitted : f.cosTransmitted;
    const Vec3 wi = normalize(m * (cosO / f.eta + cosI) - wo / f.eta);
    if (wi.z * wo.z >= 0) return {};
    const float perNormal = refractedPerNormal(f.eta, cosO, cosI);
    return {wi, transmittance * (facets.weight(wo, wi, m) / square(f.eta)), p * perNormal * (1 - f.reflectance), false,
            f.eta};
  }

 private:
  /// The facet that sends wo to wi.
  struct Facet {
    bool found = false;
    Vec3 m{};
    float cosO = 0;       ///< dot(wo, m)
    float perNormal = 0;  ///< solid angle of normals per that of wi
  };

  VIRGA_HD static Vec3 upper(Vec3 w) { return w.z >= 0 ? w : -w; }
  VIRGA_HD float relativeIndex(Vec3 wo) const { return wo.z >= 0 ? eta : 1 / eta; }
  VIRGA_HD static float refractedPerNormal(float relative, float cosO, float cosI) {
    return square(relative) * std::fabs(cosI) / square(relative * cosI + cosO);
  }
  VIRGA_HD Facet facetBetween(Vec3 wo, Vec3 wi) const {
    if (wo.z * wi.z == 0) return {};
    const float relative = relativeIndex(wo);
    const bool reflects = wo.z * wi.z > 0;
    const Vec3 between = upper(reflects ? wo + wi : wo + wi * relative);
    const float l2 = lengthSquared(between);
    if (!(l2 > 0)) return {};
    const Vec3 m = between / std::sqrt(l2);
    const float cosO = dot(wo, m), cosI = dot(wi, m);
    if (cosO * wo.z <= 0 || cosI * wi.z <= 0) return {};
    return {true, m, cosO, reflects ? 1 / (4 * std::fabs(cosO)) : refractedPerNormal(relative, cosO, cosI)};
  }
};

}  // namespace virga
