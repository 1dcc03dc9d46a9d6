// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/warp.h"
#include "scattering/bsdf_sample.h"
#include "scattering/fresnel.h"
#include "scattering/microfacet.h"
#include "scattering/thin_dielectric.h"

namespace virga {

/// Lambert's law, one-sided.
struct Diffuse {
  static constexpr int kColors = 1;
  Rgb reflectance;

  VIRGA_HD Rgb& color(int) { return reflectance; }
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
  static constexpr int kColors = 2;
  Rgb diffuse, specular;
  float exponent;

  VIRGA_HD Rgb& color(int i) { return i == 0 ? diffuse : specular; }
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
  static constexpr int kColors = 3;
  Rgb eta, k, reflectance;

  VIRGA_HD Rgb& color(int i) { return i == 0 ? eta : (i == 1 ? k : reflectance); }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2, float) const {
    if (wo.z <= 0) return {};
    return {Vec3(-wo.x, -wo.y, wo.z), reflectance * fresnelConductor(wo.z, eta, k), 1, true, 1};
  }
};

/// Smooth interface between two dielectrics; the normal points outside. Radiance that is refracted scales with the
/// square of the relative index (light walks use the adjoint, without that factor).
struct Dielectric {
  static constexpr int kColors = 2;
  float eta;  ///< inside over outside index
  Rgb reflectance, transmittance;

  VIRGA_HD Rgb& color(int i) { return i == 0 ? reflectance : transmittance; }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2, float choice) const {
    const DielectricFresnel f = fresnelDielectric(wo.z, eta);
    if (choice < f.reflectance) return {Vec3(-wo.x, -wo.y, wo.z), reflectance, f.reflectance, true, 1};
    const float scale = 1 / f.eta;
    const Vec3 wi(-wo.x * scale, -wo.y * scale, wo.z >= 0 ? -f.cosTransmitted : f.cosTransmitted);
    return {wi, transmittance * (scale * scale), 1 - f.reflectance, true, f.eta};
  }
};

/// Any of these as a tagged value; `null` surfaces are not here: nothing scatters on them. A new BSDF is a struct with
/// its colours and value, pdf and sample (or sample alone, if it is specular), a Kind, a constructor and a line in
/// dispatch().
class Bsdf {
 public:
  enum class Kind : uint8_t { diffuse, phong, conductor, dielectric, thinDielectric, roughConductor, roughDielectric };

 private:
  template <class Self, class F>
  VIRGA_HD static auto dispatch(Self& self, F&& f) {
    if (self.kind_ == Kind::diffuse) return f(self.diffuse_);  // the most common by far: no jump through a table
    switch (self.kind_) {
      case Kind::phong:
        return f(self.phong_);
      case Kind::conductor:
        return f(self.conductor_);
      case Kind::dielectric:
        return f(self.dielectric_);
      case Kind::thinDielectric:
        return f(self.thinDielectric_);
      case Kind::roughConductor:
        return f(self.roughConductor_);
      case Kind::roughDielectric:
        return f(self.roughDielectric_);
      default:
        return f(self.diffuse_);
    }
  }

 public:
  VIRGA_HD Bsdf() : Bsdf(Diffuse{}) {}
  VIRGA_HD explicit Bsdf(Diffuse b) : kind_(Kind::diffuse), diffuse_(b) {}
  explicit Bsdf(Phong b) : kind_(Kind::phong), phong_(b) {}
  explicit Bsdf(Conductor b) : kind_(Kind::conductor), conductor_(b) {}
  explicit Bsdf(Dielectric b) : kind_(Kind::dielectric), dielectric_(b) {}
  explicit Bsdf(ThinDielectric b) : kind_(Kind::thinDielectric), thinDielectric_(b) {}
  explicit Bsdf(RoughConductor b) : kind_(Kind::roughConductor), roughConductor_(b) {}
  explicit Bsdf(RoughDielectric b) : kind_(Kind::roughDielectric), roughDielectric_(b) {}

  VIRGA_HD Kind kind() const { return kind_; }
  /// A Dirac delta: value and pdf are 0 everywhere.
  VIRGA_HD bool specular() const {
    return kind_ == Kind::conductor || kind_ == Kind::dielectric || kind_ == Kind::thinDielectric;
  }
  VIRGA_HD bool transmits() const {
    return kind_ == Kind::dielectric || kind_ == Kind::thinDielectric || kind_ == Kind::roughDielectric;
  }
  /// Its lobes are so wide that a direction chosen without regard to them may serve: light is gathered at such surfaces
  /// from virtual lights.
  VIRGA_HD bool broad() const {
    return dispatch(*this, [](const auto& b) {
      if constexpr (requires { b.facets; })
        return std::fmin(b.facets.alphaX, b.facets.alphaY) >= 0.3f;
      else if constexpr (requires { b.exponent; })
        return b.exponent <= 20 || maxComponent(b.specular) == 0;
      else
        return requires { b.value(Vec3(), Vec3()); };
    });
  }
  /// Lets a part of the light go on as if nothing were there: connections look through it.
  VIRGA_HD bool isThin() const { return kind_ == Kind::thinDielectric; }
  /// That part; 0 for all others.
  VIRGA_HD Rgb straight(float cosine) const { return isThin() ? thinDielectric_.straight(cosine) : Rgb(); }
  /// Depends on how the frame lies about the normal.
  VIRGA_HD bool anisotropic() const {
    return dispatch(*this, [](const auto& b) {
      if constexpr (requires { b.facets; })
        return b.facets.alphaX != b.facets.alphaY;
      else
        return false;
    });
  }
  /// The i-th of its colours, in the order of its own struct; i < 3.
  VIRGA_HD void setColor(int i, Rgb color) {
    dispatch(*this, [=](auto& b) { b.color(i) = color; });
  }

  VIRGA_HD Rgb value(Vec3 wo, Vec3 wi) const {
    return dispatch(*this, [=](const auto& b) {
      if constexpr (requires { b.value(wo, wi); })
        return b.value(wo, wi);
      else
        return Rgb();
    });
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const {
    return dispatch(*this, [=](const auto& b) {
      if constexpr (requires { b.pdf(wo, wi); })
        return b.pdf(wo, wi);
      else
        return 0.f;
    });
  }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2 u, float choice) const {
    return dispatch(*this, [=](const auto& b) { return b.sample(wo, u, choice); });
  }

 private:
  Kind kind_;
  union {
    Diffuse diffuse_;
    Phong phong_;
    Conductor conductor_;
    Dielectric dielectric_;
    ThinDielectric thinDielectric_;
    RoughConductor roughConductor_;
    RoughDielectric roughDielectric_;
  };
};

}  // namespace virga
