// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/rgb.h"
#include "core/vec.h"
#include "core/warp.h"
#include "scattering/fresnel.h"

namespace virga {

// BSDFs, in the local shading frame: z is the shading normal; wo and wi point away from the surface, wo to the eye.
// Values are without the cosine [1/sr]; whoever integrates multiplies by |wi.z|.

struct BsdfSample {
  Vec3 wi;
  Rgb weight;     ///< value * |wi.z| / pdf; for a specular BSDF the whole reflectance or transmittance of the branch
  float pdf = 0;  ///< [1/sr]; 0: no sample. For a specular BSDF the probability of the branch.
  bool specular = false;  ///< a Dirac delta: no other direction connects
  float eta = 1;          ///< relative index of refraction that the ray passed (for Russian roulette); 1 for reflection
};

/// Lambert's law, one-sided.
struct Diffuse {
  Rgb reflectance;

  VIRGA_HD Rgb value(Vec3 wo, Vec3 wi) const { return wo.z > 0 && wi.z > 0 ? reflectance * kInvPi : Rgb(); }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const { return wo.z > 0 && wi.z > 0 ? wi.z * kInvPi : 0; }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2 u, float) const {
    if (wo.z <= 0) return {};
    const Vec3 wi = cosineHemisphere(u);
    return {wi, reflectance, wi.z * kInvPi, false, 1};
  }
};

/// Modified Phong model (Lafortune and Willems 1994), one-sided: diffuse / pi + specular (n + 2) / (2 pi) cos^n(alpha),
/// alpha the angle to the mirror direction. Energy is conserved where diffuse + specular <= 1.
struct Phong {
  Rgb diffuse, specular;
  float exponent;

  VIRGA_HD float diffuseProbability() const {
    const float d = maxComponent(diffuse), s = maxComponent(specular);
    return d + s > 0 ? d / (d + s) : 1;
  }
  VIRGA_HD static float cosAlpha(Vec3 wo, Vec3 wi) { return std::max(0.f, wo.z * wi.z - wo.x * wi.x - wo.y * wi.y); }
  VIRGA_HD Rgb value(Vec3 wo, Vec3 wi) const {
    if (wo.z <= 0 || wi.z <= 0) return {};
    return diffuse * kInvPi + specular * ((exponent + 2) / kTwoPi * std::pow(cosAlpha(wo, wi), exponent));
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    if (wo.z <= 0 || wi.z <= 0) return 0;
    const float lobe = (exponent + 1) / kTwoPi * std::pow(cosAlpha(wo, wi), exponent);
    return lerp(lobe, wi.z * kInvPi, diffuseProbability());
  }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2 u, float choice) const {
    if (wo.z <= 0) return {};
    Vec3 wi;
    if (choice < diffuseProbability()) {
      wi = cosineHemisphere(u);
    } else {
      const float c = std::pow(1 - u.x, 1 / (exponent + 1));
      const Vec3 lobe = sphericalDirection(std::sqrt(std::max(0.f, 1 - c * c)), c, kTwoPi * u.y);
      wi = Frame(Vec3(-wo.x, -wo.y, wo.z)).toWorld(lobe);
    }
    const float p = pdf(wo, wi);
    if (p <= 0) return {};
    return {wi, value(wo, wi) * (wi.z / p), p, false, 1};
  }
};

/// Smooth metal, one-sided. eta + i k relative to the outside; a perfect mirror for eta = 0, k = 1.
struct Conductor {
  Rgb eta, k, reflectance;

  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2, float) const {
    if (wo.z <= 0) return {};
    return {Vec3(-wo.x, -wo.y, wo.z), reflectance * fresnelConductor(wo.z, eta, k), 1, true, 1};
  }
};

/// Smooth interface between two dielectrics; the normal points outside. Radiance that is refracted scales with the
/// square of the relative index (light walks use the adjoint, without that factor).
struct Dielectric {
  float eta;  ///< inside over outside index
  Rgb reflectance, transmittance;

  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2, float choice) const {
    const DielectricFresnel f = fresnelDielectric(wo.z, eta);
    if (choice < f.reflectance) return {Vec3(-wo.x, -wo.y, wo.z), reflectance, f.reflectance, true, 1};
    const float scale = 1 / f.eta;
    const Vec3 wi(-wo.x * scale, -wo.y * scale, wo.z >= 0 ? -f.cosTransmitted : f.cosTransmitted);
    return {wi, transmittance * (scale * scale), 1 - f.reflectance, true, f.eta};
  }
};

/// Any of the above as a tagged value; `null` surfaces are not here: nothing scatters on them. A new BSDF is a struct
/// with value, pdf and sample (or sample alone, if it is specular), a Kind, a constructor and a line in visit().
class Bsdf {
 public:
  enum class Kind : uint8_t { diffuse, phong, conductor, dielectric };

  Bsdf() : Bsdf(Diffuse{}) {}
  explicit Bsdf(Diffuse b) : kind_(Kind::diffuse), diffuse_(b) {}
  explicit Bsdf(Phong b) : kind_(Kind::phong), phong_(b) {}
  explicit Bsdf(Conductor b) : kind_(Kind::conductor), conductor_(b) {}
  explicit Bsdf(Dielectric b) : kind_(Kind::dielectric), dielectric_(b) {}

  VIRGA_HD Kind kind() const { return kind_; }
  /// A Dirac delta: value and pdf are 0 everywhere.
  VIRGA_HD bool specular() const { return kind_ == Kind::conductor || kind_ == Kind::dielectric; }
  VIRGA_HD bool transmits() const { return kind_ == Kind::dielectric; }

  VIRGA_HD Rgb value(Vec3 wo, Vec3 wi) const {
    if (kind_ == Kind::diffuse) return diffuse_.value(wo, wi);
    if (kind_ == Kind::phong) return phong_.value(wo, wi);
    return {};
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    if (kind_ == Kind::diffuse) return diffuse_.pdf(wo, wi);
    if (kind_ == Kind::phong) return phong_.pdf(wo, wi);
    return 0;
  }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2 u, float choice) const {
    switch (kind_) {
      case Kind::phong:
        return phong_.sample(wo, u, choice);
      case Kind::conductor:
        return conductor_.sample(wo, u, choice);
      case Kind::dielectric:
        return dielectric_.sample(wo, u, choice);
      default:
        return diffuse_.sample(wo, u, choice);
    }
  }

 private:
  Kind kind_;
  union {
    Diffuse diffuse_;
    Phong phong_;
    Conductor conductor_;
    Dielectric dielectric_;
  };
};

}  // namespace virga
