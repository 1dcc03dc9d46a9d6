// SPDX-License-Identifier: Apache-2.0
#include "scattering/microfacet.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "core/random.h"
#include "scattering/bsdf.h"
#include "stats/stats.h"

namespace virga {
namespace {

using Kind = Microfacet::Kind;
using Sampling = Microfacet::Sampling;

const Vec3 kOutgoing[] = {Vec3(0, 0, 1), normalize(Vec3(0.3f, -0.5f, 0.8f)), normalize(Vec3(-1, 0.4f, 0.3f)),
                          normalize(Vec3(0.8f, 0.6f, 0.05f))};

Vec3 mirrored(Vec3 w) { return {-w.x, -w.y, w.z}; }
Vec3 below(Vec3 w) { return {w.x, w.y, -w.z}; }

std::vector<Microfacet> someFacets() {
  std::vector<Microfacet> all;
  for (const Kind kind : {Kind::beckmann, Kind::ggx})
    for (const Sampling sampling : {Sampling::visible, Sampling::all})
      for (const Vec2 alpha : {Vec2{0.1f, 0.1f}, {0.6f, 0.6f}, {0.15f, 0.5f}})
        all.push_back({kind, sampling, alpha.x, alpha.y});
  return all;
}

std::string nameOf(const Microfacet& f) {
  return (f.kind == Kind::ggx ? "ggx " : "beckmann ") + std::string(f.sampling == Sampling::all ? "all " : "visible ") +
         std::to_string(f.alphaX) + " " + std::to_string(f.alphaY);
}

/// Enough for every control below to be noticed.
constexpr int64_t kDraws = 100'000;

double normalsP(const Microfacet& drawn, const Microfacet& claimed, Vec3 wo) {
  return stats::chiSquared(
      {.samples = kDraws}, [&](Vec2 u) { return drawn.sampleNormal(wo, u); },
      [&](Vec3 m) { return claimed.pdf(wo, m); });
}

template <class Model>
double samplingP(const Model& drawn, const Model& claimed, Vec3 wo, Vec3 axis) {
  Pcg32 choices(99);
  return stats::chiSquared(
      {.theta = 24, .axis = axis, .samples = kDraws},
      [&](Vec2 u) -> std::optional<Vec3> {
        const BsdfSample s = drawn.sample(wo, u, choices.next());
        return s.pdf > 0 ? std::optional(s.wi) : std::nullopt;
      },
      [&](Vec3 wi) { return claimed.pdf(wo, wi); });
}

/// Share of the power from wo that goes anywhere: radiance that was compressed by refraction is stretched again.
template <class Model>
stats::Moments albedo(const Model& model, Vec3 wo, int samples = 100'000) {
  stats::Moments weights;
  Pcg32 rng(17);
  for (int i = 0; i < samples; ++i) {
    const BsdfSample s = model.sample(wo, {rng.next(), rng.next()}, rng.next());
    weights.add(s.pdf > 0 ? static_cast<double>(s.weight.g * square(s.eta)) : 0);
  }
  return weights;
}

TEST(Microfacet, NormalsCoverTheirArea) {
  for (const Microfacet& f : someFacets()) {
    EXPECT_NEAR(stats::integrateSphere([&](Vec3 m) { return f.density(m) * m.z; }), 1, 1e-4) << nameOf(f);
    for (const Vec3 wo : kOutgoing) {
      EXPECT_NEAR(stats::integrateSphere([&](Vec3 m) { return f.pdf(wo, m); }), 1, 2e-4) << nameOf(f) << wo.z;
      // Smith: what is seen of the facets that face wo covers the surface's own projection.
      const double seen =
          stats::integrateSphere([&](Vec3 m) { return f.density(m) * f.unshadowed(wo) * std::max(0.f, dot(wo, m)); });
      EXPECT_NEAR(seen, wo.z, 2e-4) << nameOf(f) << wo.z;
    }
  }
}

TEST(Microfacet, SampledNormalsFollowTheDensity) {
  for (const Microfacet& f : someFacets())
    for (const Vec3 wo : kOutgoing) {
      EXPECT_GT(normalsP(f, f, wo), 1e-4) << nameOf(f) << " " << wo.z;
      const Microfacet rougher{f.kind, f.sampling, 1.04f * f.alphaX, 1.04f * f.alphaY};
      EXPECT_LT(normalsP(f, rougher, wo), 1e-4) << "the test cannot fail: " << nameOf(f) << " " << wo.z;
    }
}

TEST(Microfacet, TheTwoKindsAreNotTheSame) {
  const Microfacet beckmann{Kind::beckmann, Sampling::visible, 0.3f, 0.3f},
      ggx{Kind::ggx, Sampling::visible, 0.3f, 0.3f};
  EXPECT_LT(normalsP(beckmann, ggx, kOutgoing[1]), 1e-4);
}

// By slopes: along x the root of the mean square of Beckmann's is alphaX / sqrt(2).
TEST(Microfacet, AlphaMeasuresSlopes) {
  const Microfacet f{Kind::beckmann, Sampling::all, 0.2f, 0.5f};
  Pcg32 rng(5);
  stats::Moments x2, y2;
  for (int i = 0; i < 100'000; ++i) {
    const Vec3 m = f.sampleNormal({0, 0, 1}, {rng.next(), rng.next()});
    x2.add(static_cast<double>(square(m.x / m.z)));
    y2.add(static_cast<double>(square(m.y / m.z)));
  }
  EXPECT_NEAR(x2.mean(), 0.02, 4 * x2.standardError());
  EXPECT_NEAR(y2.mean(), 0.125, 4 * y2.standardError());
}

TEST(RoughConductor, SamplesFollowTheDensity) {
  for (const Microfacet& f : someFacets())
    for (const Vec3 wo : kOutgoing) {
      const RoughConductor metal{f, Rgb(0.f), Rgb(1.f), Rgb(1.f)};
      RoughConductor wrong = metal;
      wrong.facets.alphaX *= 1.06f;
      wrong.facets.alphaY *= 1.06f;
      // At grazing incidence the horizon cuts through the peak: rings about the normal end there.
      const Vec3 axis = wo.z < 0.1f ? Vec3(0, 0, 1) : mirrored(wo);
      EXPECT_GT(samplingP(metal, metal, wo, axis), 1e-4) << nameOf(f) << " " << wo.z;
      EXPECT_LT(samplingP(metal, wrong, wo, axis), 1e-4) << "cannot fail: " << nameOf(f) << " " << wo.z;
    }
}

TEST(RoughConductor, DensityLosesOnlyWhatFallsBelowTheHorizon) {
  for (const Microfacet& f : someFacets()) {
    const RoughConductor metal{f, Rgb(0.f), Rgb(1.f), Rgb(1.f)};
    for (const Vec3 wo : kOutgoing) {
      const double total = stats::integrateSphere([&](Vec3 wi) { return metal.pdf(wo, wi); }, mirrored(wo), 1e-4);
      EXPECT_LE(total, 1 + 1e-3) << nameOf(f) << " " << wo.z;
      EXPECT_GT(total, f.alphaX == 0.1f && wo.z > 0.5f ? 0.98 : 0) << nameOf(f) << " " << wo.z;
    }
  }
}

template <class Model>
void expectConsistentSamples(const Model& model, double etaSquared) {
  Pcg32 rng(19);
  int transmitted = 0;
  for (int i = 0; i < 20'000; ++i) {
    Vec3 wo = cosineHemisphere({rng.next(), rng.next()});
    if (etaSquared > 0 && rng.next() < 0.5f) wo = below(wo);
    const BsdfSample s = model.sample(wo, {rng.next(), rng.next()}, rng.next());
    if (s.pdf <= 0 || std::fabs(wo.z) < 1e-3f || std::fabs(s.wi.z) < 1e-3f) continue;
    ASSERT_FALSE(s.specular);
    ASSERT_NEAR(length(s.wi), 1, 2e-6);
    const float pdf = model.pdf(wo, s.wi);
    // Toward grazing, the half vector loses digits.
    const float tolerance = 2e-3f / std::sqrt(std::min(std::fabs(wo.z), std::fabs(s.wi.z)));
    ASSERT_NEAR(s.pdf, pdf, tolerance * pdf) << wo.z << " " << s.wi.z;
    const Rgb there = model.value(wo, s.wi), back = model.value(s.wi, wo);
    const bool through = wo.z * s.wi.z < 0;
    transmitted += through;
    ASSERT_EQ(s.eta != 1, through);
    // Radiance scales with the square of the index where it is refracted: reciprocity holds without that factor.
    const double scale = through ? (wo.z > 0 ? etaSquared : 1 / etaSquared) : 1;
    for (int c = 0; c < 3; ++c) {
      ASSERT_NEAR(s.weight[c], there[c] * std::fabs(s.wi.z) / pdf, tolerance * s.weight[c]);
      // Near total reflection, what is left of 1 - F loses digits.
      const double expected = scale * static_cast<double>(there[c]);
      ASSERT_NEAR(static_cast<double>(back[c]), expected, static_cast<double>(tolerance) * expected + 3e-6)
          << "reciprocity " << wo.z << " " << s.wi.z;
    }
  }
  EXPECT_GT(transmitted, etaSquared > 0 ? 5000 : -1);
}

TEST(RoughConductor, SampleAgreesWithValueAndBothWaysAreEqual) {
  for (const Microfacet& f : someFacets())
    expectConsistentSamples(RoughConductor{f, Rgb(0.2f, 0.9f, 1.1f), Rgb(3.9f, 2.4f, 2.1f), Rgb(0.9f, 0.5f, 1)}, 0);
}

TEST(RoughConductor, IsOneSided) {
  const RoughConductor metal{{}, Rgb(0.f), Rgb(1.f), Rgb(1.f)};
  const Vec3 wo = kOutgoing[1], wi = mirrored(wo);
  EXPECT_FALSE(isBlack(metal.value(wo, wi)));
  for (auto [o, i] : {std::pair(wo, below(wi)), {below(wo), wi}, {below(wo), below(wi)}}) {
    EXPECT_TRUE(isBlack(metal.value(o, i)));
    EXPECT_EQ(metal.pdf(o, i), 0);
  }
  EXPECT_EQ(metal.sample(below(wo), {0.3f, 0.6f}, 0.5f).pdf, 0);
}

TEST(RoughConductor, ConservesEnergyAndLosesLittleWhereItIsSmooth) {
  for (const Microfacet& f : someFacets()) {
    const RoughConductor mirror{f, Rgb(0.f), Rgb(1.f), Rgb(1.f)};
    for (const Vec3 wo : kOutgoing) {
      const stats::Moments sampled = albedo(mirror, wo);
      EXPECT_LE(sampled.mean(), 1 + 4 * sampled.standardError()) << nameOf(f) << " " << wo.z;
      const double integral =
          stats::integrateSphere([&](Vec3 wi) { return mirror.value(wo, wi).g * std::fabs(wi.z); }, mirrored(wo), 1e-4);
      EXPECT_NEAR(sampled.mean(), integral, 4 * sampled.standardError() + 2e-3) << nameOf(f) << " " << wo.z;
    }
  }
  for (const Kind kind : {Kind::beckmann, Kind::ggx}) {
    const RoughConductor smooth{{kind, Sampling::visible, 0.01f, 0.01f}, Rgb(0.f), Rgb(1.f), Rgb(1.f)};
    EXPECT_NEAR(albedo(smooth, kOutgoing[1]).mean(), 1, 2e-3);
    const RoughConductor rough{{kind, Sampling::visible, 0.6f, 0.6f}, Rgb(0.f), Rgb(1.f), Rgb(1.f)};
    EXPECT_LT(albedo(rough, kOutgoing[1]).mean(), 0.95) << "single scattering loses light: the test can fail";
  }
}

TEST(RoughConductor, WithoutRoughnessIsAConductor) {
  const Rgb eta(0.2f, 0.9f, 1.1f), k(3.9f, 2.4f, 2.1f);
  const Conductor smooth{eta, k, Rgb(0.8f)};
  for (const Kind kind : {Kind::beckmann, Kind::ggx})
    for (const Vec3 wo : {kOutgoing[0], kOutgoing[1], kOutgoing[2]}) {
      const RoughConductor rough{{kind, Sampling::visible, 1e-4f, 1e-4f}, eta, k, Rgb(0.8f)};
      const BsdfSample a = rough.sample(wo, {0.4f, 0.7f}, 0.5f), b = smooth.sample(wo, {}, 0.5f);
      EXPECT_LT(distance(a.wi, b.wi), 1e-3f);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(a.weight[c], b.weight[c], 1e-3f);
    }
}

TEST(RoughDielectric, SamplesFollowTheDensity) {
  for (const Microfacet& f : someFacets())
    for (const float eta : {1.5f, 0.7f})
      for (const Vec3 up : {kOutgoing[1], kOutgoing[2]})
        for (const Vec3 wo : {up, below(up)}) {
          const RoughDielectric glass{f, eta, Rgb(1.f), Rgb(1.f)};
          const Vec3 axis = Dielectric{eta, Rgb(1.f), Rgb(1.f)}.sample(wo, {}, 0x1.fffffep-1f).wi;
          EXPECT_GT(samplingP(glass, glass, wo, axis), 1e-4) << nameOf(f) << " " << eta << " " << wo.z;
          RoughDielectric wrong = glass;
          wrong.facets.alphaX *= 1.1f;
          wrong.facets.alphaY *= 1.1f;
          EXPECT_LT(samplingP(glass, wrong, wo, axis), 1e-4) << "cannot fail: " << nameOf(f) << " " << eta << wo.z;
        }
}

TEST(RoughDielectric, SampleAgreesWithValueAndBothWaysAreEqual) {
  for (const Microfacet& f : someFacets())
    for (const float eta : {1.5f, 0.7f})
      expectConsistentSamples(RoughDielectric{f, eta, Rgb(0.9f, 0.5f, 1), Rgb(0.3f, 1, 0.8f)},
                              static_cast<double>(eta * eta));
}

TEST(RoughDielectric, ConservesEnergyAndLosesLittleWhereItIsSmooth) {
  for (const Microfacet& f : someFacets())
    for (const float eta : {1.5f, 0.7f})
      for (const Vec3 up : kOutgoing)
        for (const Vec3 wo : {up, below(up)}) {
          const stats::Moments m = albedo(RoughDielectric{f, eta, Rgb(1.f), Rgb(1.f)}, wo);
          EXPECT_LE(m.mean(), 1 + 4 * m.standardError()) << nameOf(f) << " " << eta << " " << wo.z;
        }
  for (const Kind kind : {Kind::beckmann, Kind::ggx})
    for (const Vec3 wo : {kOutgoing[1], below(kOutgoing[1])}) {
      const RoughDielectric smooth{{kind, Sampling::visible, 0.01f, 0.01f}, 1.5f, Rgb(1.f), Rgb(1.f)};
      EXPECT_NEAR(albedo(smooth, wo).mean(), 1, 2e-3);
      const RoughDielectric rough{{kind, Sampling::visible, 0.6f, 0.6f}, 1.5f, Rgb(1.f), Rgb(1.f)};
      EXPECT_LT(albedo(rough, wo).mean(), 0.99) << "the test can fail";
    }
}

TEST(RoughDielectric, WithoutRoughnessIsADielectric) {
  const Dielectric smooth{1.5f, Rgb(0.8f), Rgb(0.6f)};
  for (const Kind kind : {Kind::beckmann, Kind::ggx})
    for (const Vec3 up : {kOutgoing[0], kOutgoing[1], kOutgoing[2]})
      for (const Vec3 wo : {up, below(up)})
        for (const float choice : {0.f, 0x1.fffffep-1f}) {
          const RoughDielectric rough{{kind, Sampling::visible, 1e-4f, 1e-4f}, 1.5f, Rgb(0.8f), Rgb(0.6f)};
          const BsdfSample a = rough.sample(wo, {0.4f, 0.7f}, choice), b = smooth.sample(wo, {}, choice);
          EXPECT_LT(distance(a.wi, b.wi), 2e-3f) << wo.z;
          EXPECT_NEAR(a.weight.g, b.weight.g, 1e-3f);
          EXPECT_EQ(a.eta, b.eta);
        }
}

TEST(ThinDielectric, AddsUpAllReflectionsInside) {
  for (const float eta : {1.5f, 0.7f, 2.4f})
    for (const Vec3 wo : kOutgoing) {
      const ThinDielectric pane{eta, Rgb(1.f), Rgb(1.f)};
      const auto r = static_cast<double>(fresnelDielectric(wo.z, eta).reflectance);
      double sum = r, inside = (1 - r) * (1 - r) * r;
      for (int i = 0; i < 4000; ++i, inside *= r * r) sum += inside;
      if (r == 1) sum = 1;
      EXPECT_NEAR(pane.reflectedShare(wo.z), sum, 2e-5) << eta << " " << wo.z;
      EXPECT_EQ(pane.reflectedShare(wo.z), pane.reflectedShare(-wo.z)) << "both sides are alike";
    }
}

TEST(ThinDielectric, MirrorsOrLetsPass) {
  const ThinDielectric pane{1.5f, Rgb(0.8f, 0.5f, 0.1f), Rgb(0.3f, 0.6f, 0.9f)};
  for (const Vec3 up : kOutgoing)
    for (const Vec3 wo : {up, below(up)}) {
      const BsdfSample back = pane.sample(wo, {}, 0), through = pane.sample(wo, {}, 0x1.fffffep-1f);
      EXPECT_EQ(back.wi, mirrored(wo));
      EXPECT_EQ(back.weight, pane.reflectance);
      EXPECT_EQ(through.wi, -wo) << "straight on";
      EXPECT_EQ(through.weight, pane.transmittance) << "no scaling of radiance: the same medium on both sides";
      EXPECT_EQ(through.eta, 1);
      EXPECT_FLOAT_EQ(back.pdf + through.pdf, 1);
      EXPECT_TRUE(back.specular && through.specular);
    }
}

TEST(Bsdf, HoldsTheNewOnes) {
  const Microfacet stretched{Kind::ggx, Sampling::visible, 0.1f, 0.3f};
  const Bsdf metal(RoughConductor{stretched, Rgb(0.f), Rgb(1.f), Rgb(0.5f)});
  Bsdf glass(RoughDielectric{{}, 1.5f, Rgb(1.f), Rgb(1.f)}), pane(ThinDielectric{1.5f, Rgb(1.f), Rgb(1.f)});
  EXPECT_TRUE(metal.anisotropic() && !glass.anisotropic() && !pane.anisotropic());
  EXPECT_FALSE(metal.specular() || metal.transmits() || glass.specular());
  EXPECT_TRUE(glass.transmits() && pane.transmits() && pane.specular());
  const Vec3 wo = kOutgoing[1], wi = mirrored(wo);
  EXPECT_EQ(metal.value(wo, wi), (RoughConductor{stretched, Rgb(0.f), Rgb(1.f), Rgb(0.5f)}.value(wo, wi)));
  EXPECT_EQ(metal.pdf(wo, wi), (RoughConductor{stretched, Rgb(0.f), Rgb(1.f), Rgb(0.5f)}.pdf(wo, wi)));
  glass.setColor(1, Rgb(0.25f));
  EXPECT_EQ(glass.value(wo, wi), (RoughDielectric{{}, 1.5f, Rgb(1.f), Rgb(0.25f)}.value(wo, wi)));
  EXPECT_FLOAT_EQ(glass.value(wo, -wo).g, (RoughDielectric{{}, 1.5f, Rgb(1.f), Rgb(0.25f)}.value(wo, -wo).g));
  pane.setColor(0, Rgb(0.75f));
  EXPECT_EQ(pane.sample(wo, {}, 0).weight, Rgb(0.75f));
}

}  // namespace
}  // namespace virga
