// SPDX-License-Identifier: Apache-2.0
#include "scattering/bsdf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "core/random.h"
#include "stats/stats.h"

namespace virga {
namespace {

// From along the normal to grazing.
const Vec3 kOutgoing[] = {Vec3(0, 0, 1), normalize(Vec3(0.3f, -0.5f, 0.8f)), normalize(Vec3(-1, 0.4f, 0.3f)),
                          normalize(Vec3(0.8f, 0.6f, 0.02f))};
constexpr float kExponents[] = {1, 30, 500};

template <class Model>
double samplingP(const Model& drawn, const Model& claimed, Vec3 wo) {
  Pcg32 choices(99);
  return stats::chiSquared(
      {.theta = 24},
      [&](Vec2 u) -> std::optional<Vec3> {
        const BsdfSample s = drawn.sample(wo, u, choices.next());
        return s.pdf > 0 ? std::optional(s.wi) : std::nullopt;
      },
      [&](Vec3 wi) { return claimed.pdf(wo, wi); });
}

// Fraction of the light from wo that is scattered anywhere [1].
template <class Model>
double albedo(const Model& model, Vec3 wo) {
  return stats::integrateSphere([&](Vec3 wi) { return model.value(wo, wi).g * std::fabs(wi.z); });
}

template <class Model>
stats::Moments sampledAlbedo(const Model& model, Vec3 wo) {
  stats::Moments weights;
  Pcg32 rng(17);
  for (int i = 0; i < 100'000; ++i) {
    const BsdfSample s = model.sample(wo, {rng.next(), rng.next()}, rng.next());
    weights.add(s.pdf > 0 ? static_cast<double>(s.weight.g) : 0);
  }
  return weights;
}

template <class Model>
void expectConsistentSamples(const Model& model) {
  Pcg32 rng(19);
  for (int i = 0; i < 5000; ++i) {
    const Vec3 wo = cosineHemisphere({rng.next(), rng.next()});
    const BsdfSample s = model.sample(wo, {rng.next(), rng.next()}, rng.next());
    if (s.pdf <= 0) continue;
    ASSERT_FALSE(s.specular);
    ASSERT_EQ(s.eta, 1);
    ASSERT_GT(s.wi.z, 0);
    ASSERT_NEAR(length(s.wi), 1, 1e-6);
    ASSERT_NEAR(s.pdf, model.pdf(wo, s.wi), 1e-4f * s.pdf);
    const Rgb weight = model.value(wo, s.wi) * (s.wi.z / s.pdf), back = model.value(s.wi, wo),
              there = model.value(wo, s.wi);
    for (int c = 0; c < 3; ++c) {
      ASSERT_NEAR(s.weight[c], weight[c], 1e-4f * weight[c]);
      ASSERT_NEAR(there[c], back[c], 1e-5f * there[c]) << "reciprocity";
    }
  }
}

template <class Model>
void expectNothingBelow(const Model& model) {
  const Vec3 above = kOutgoing[1], below(above.x, above.y, -above.z);
  for (auto [wo, wi] : {std::pair(above, below), {below, above}, {below, below}}) {
    EXPECT_TRUE(isBlack(model.value(wo, wi)));
    EXPECT_EQ(model.pdf(wo, wi), 0);
  }
  EXPECT_EQ(model.sample(below, {0.3f, 0.6f}, 0.5f).pdf, 0);
}

TEST(Diffuse, SamplesFollowTheDensity) {
  const Diffuse diffuse{Rgb(0.2f, 0.5f, 1)};
  for (Vec3 wo : kOutgoing) {
    EXPECT_GT(samplingP(diffuse, diffuse, wo), 1e-4);
    EXPECT_NEAR(stats::integrateSphere([&](Vec3 wi) { return diffuse.pdf(wo, wi); }), 1, 1e-5);
    EXPECT_NEAR(albedo(diffuse, wo), 0.5, 1e-5);
  }
  const double wrong = stats::chiSquared(
      {}, [&](Vec2 u) { return diffuse.sample(kOutgoing[1], u, 0).wi; },
      [](Vec3 wi) { return wi.z > 0 ? 1.02f * kInvPi * std::pow(wi.z, 1.04f) : 0; });
  EXPECT_LT(wrong, 1e-4) << "the test cannot fail";
  expectConsistentSamples(diffuse);
  expectNothingBelow(diffuse);
}

TEST(Phong, SamplesFollowTheDensity) {
  for (float exponent : kExponents)
    for (float share : {0.f, 0.4f})
      for (Vec3 wo : kOutgoing) {
        const Phong phong{Rgb(share), Rgb(1 - share), exponent};
        const Phong wrong{phong.diffuse, phong.specular, 1.08f * exponent + 0.1f};
        EXPECT_GT(samplingP(phong, phong, wo), 1e-4) << exponent << " " << share << " " << wo.z;
        EXPECT_LT(samplingP(phong, wrong, wo), 1e-4)
            << "the test cannot fail at " << exponent << " " << share << " " << wo.z;
      }
}

TEST(Phong, DensityLosesOnlyWhatFallsBelowTheHorizon) {
  for (float exponent : kExponents) {
    const Phong phong{Rgb(0.f), Rgb(1.f), exponent};
    const auto total = [&](Vec3 wo) { return stats::integrateSphere([&](Vec3 wi) { return phong.pdf(wo, wi); }); };
    EXPECT_NEAR(total(kOutgoing[0]), 1, 2e-5) << exponent;
    EXPECT_LT(total(kOutgoing[3]), exponent < 100 ? 0.6 : 0.7) << exponent;
    for (Vec3 wo : kOutgoing) EXPECT_LE(total(wo), 1 + 2e-5) << exponent;
  }
}

TEST(Phong, ConservesEnergy) {
  for (float exponent : kExponents)
    for (float share : {0.f, 0.4f}) {
      const Phong phong{Rgb(share), Rgb(1 - share), exponent}, excessive{Rgb(share), Rgb(1.01f - share), exponent};
      for (Vec3 wo : kOutgoing) EXPECT_LE(albedo(phong, wo), 1 + 2e-5) << exponent << " " << share;
      EXPECT_NEAR(albedo(phong, kOutgoing[0]), 1, 2e-5) << "the bound is reached along the normal";
      EXPECT_GT(albedo(excessive, kOutgoing[0]), 1.005) << "the test cannot fail";
    }
}

TEST(Phong, WeightsAverageToTheAlbedo) {
  for (float exponent : kExponents)
    for (Vec3 wo : kOutgoing) {
      const Phong phong{Rgb(0.1f, 0.3f, 0.2f), Rgb(0.6f, 0.5f, 0.1f), exponent};
      const stats::Moments sampled = sampledAlbedo(phong, wo);
      EXPECT_NEAR(sampled.mean(), albedo(phong, wo), 4 * sampled.standardError() + 3e-5) << exponent << " " << wo.z;
    }
}

TEST(Phong, SampleAgreesWithValue) {
  for (float exponent : kExponents)
    expectConsistentSamples(Phong{Rgb(0.1f, 0.3f, 0.2f), Rgb(0.6f, 0.5f, 0.1f), exponent});
  expectConsistentSamples(Phong{Rgb(0.f), Rgb(1.f), 0});
  expectConsistentSamples(Phong{Rgb(1.f), Rgb(0.f), 50});
  expectNothingBelow(Phong{Rgb(0.5f), Rgb(0.5f), 20});
}

TEST(Phong, BlackSurfacesScatterNothing) {
  EXPECT_EQ(sampledAlbedo(Phong{Rgb(0.f), Rgb(0.f), 10}, kOutgoing[1]).mean(), 0);
}

TEST(Conductor, MirrorsOnOneSide) {
  const Conductor mirror{Rgb(0.f), Rgb(1.f), Rgb(0.9f, 0.5f, 0.1f)};
  for (Vec3 wo : kOutgoing) {
    const BsdfSample s = mirror.sample(wo, {}, 0.5f);
    EXPECT_EQ(s.wi, Vec3(-wo.x, -wo.y, wo.z));
    EXPECT_EQ(s.weight, Rgb(0.9f, 0.5f, 0.1f));
    EXPECT_EQ(s.pdf, 1);
    EXPECT_EQ(s.eta, 1);
    EXPECT_TRUE(s.specular);
  }
  EXPECT_EQ(mirror.sample({0, 0, -1}, {}, 0.5f).pdf, 0);
}

TEST(Conductor, WeightIsTheFresnelReflectancePerChannel) {
  const Conductor gold{Rgb(0.143f, 0.374f, 1.442f), Rgb(3.983f, 2.385f, 1.603f), Rgb(0.5f)};
  for (Vec3 wo : kOutgoing)
    for (int c = 0; c < 3; ++c)
      EXPECT_EQ(gold.sample(wo, {}, 0).weight[c], 0.5f * fresnelConductor(wo.z, gold.eta[c], gold.k[c]));
}

// Directions on both sides of a glass surface, from grazing to normal.
std::vector<Vec3> bothSides() {
  std::vector<Vec3> out;
  for (float side : {1.f, -1.f})
    for (float c : {1e-3f, 0.05f, 0.3f, 0.6f, 0.75f, 0.9f, 0.9999f, 1.f}) {
      const float s = std::sqrt((1 - c) * (1 + c));
      out.emplace_back(0.6f * s, -0.8f * s, side * c);
    }
  return out;
}

TEST(Dielectric, RefractsBySnellsLaw) {
  for (float eta : {1.5f, 1.0003f, 0.7f, 2.4f})
    for (Vec3 wo : bothSides()) {
      const BsdfSample s = Dielectric{eta, Rgb(1.f), Rgb(1.f)}.sample(wo, {}, 0x1.fffffep-1f);
      const float relative = wo.z > 0 ? eta : 1 / eta;
      const float sine = std::hypot(wo.x, wo.y);
      if (sine >= relative) {
        EXPECT_EQ(s.wi, Vec3(-wo.x, -wo.y, wo.z)) << "total reflection";
        EXPECT_EQ(s.pdf, 1);
        continue;
      }
      EXPECT_LT(s.wi.z * wo.z, 0) << eta << " " << wo.z;
      EXPECT_NEAR(length(s.wi), 1, 2e-6) << eta << " " << wo.z;
      EXPECT_NEAR(std::hypot(s.wi.x, s.wi.y) * relative, sine, 1e-6);
      EXPECT_NEAR(s.wi.x * wo.y, s.wi.y * wo.x, 1e-6) << "in the plane of incidence";
      EXPECT_LE(s.wi.x * wo.x + s.wi.y * wo.y, 0) << "on the far side of the normal";
      EXPECT_EQ(s.eta, relative);
      EXPECT_TRUE(s.specular);
    }
}

TEST(Dielectric, BranchesConserveEnergy) {
  for (float eta : {1.5f, 0.7f, 1.f})
    for (Vec3 wo : bothSides()) {
      const Dielectric glass{eta, Rgb(1.f), Rgb(1.f)};
      const BsdfSample reflected = glass.sample(wo, {}, 0), transmitted = glass.sample(wo, {}, 0x1.fffffep-1f);
      const bool total = transmitted.wi.z * wo.z > 0;
      // Radiance is compressed by eta^2 where it enters the denser side; with that taken out, nothing is lost.
      const double through =
          total ? 0 : static_cast<double>(transmitted.pdf * transmitted.weight.g * square(transmitted.eta));
      const double back = reflected.wi.z * wo.z > 0 ? static_cast<double>(reflected.pdf * reflected.weight.g) : 0;
      EXPECT_NEAR(back + through, 1, 1e-6) << eta << " " << wo.z;
    }
}

TEST(Dielectric, BranchIsChosenWithItsProbability) {
  const Dielectric glass{1.5f, Rgb(0.8f), Rgb(0.4f)};
  const Vec3 wo = kOutgoing[2];
  const float reflectance = fresnelDielectric(wo.z, 1.5f).reflectance;
  Pcg32 rng(23);
  std::vector<double> counts(2, 0.0);
  for (int i = 0; i < 100'000; ++i) {
    const BsdfSample s = glass.sample(wo, {}, rng.next());
    ++counts[s.wi.z > 0 ? 0 : 1];
    ASSERT_EQ(s.pdf, s.wi.z > 0 ? reflectance : 1 - reflectance);
    ASSERT_NEAR(s.weight.g, s.wi.z > 0 ? 0.8f : 0.4f / 2.25f, 1e-6);
  }
  const auto p = [&](double r) { return stats::chiSquaredCounts(counts, std::vector<double>{1e5 * r, 1e5 * (1 - r)}); };
  EXPECT_GT(p(static_cast<double>(reflectance)), 1e-4);
  EXPECT_LT(p(static_cast<double>(reflectance) + 0.01), 1e-4) << "the test cannot fail";
}

TEST(Dielectric, MatchedIndexIsInvisible) {
  for (Vec3 wo : bothSides()) {
    const BsdfSample s = Dielectric{1, Rgb(1.f), Rgb(1.f)}.sample(wo, {}, 0);  // would reflect if anything did
    EXPECT_NEAR(distance(s.wi, -wo), 0, 1e-6) << wo.z;
    EXPECT_EQ(s.weight, Rgb(1.f)) << wo.z;
  }
}

TEST(Bsdf, ForwardsToWhatItHolds) {
  const Vec3 wo = kOutgoing[1], wi = normalize(Vec3(-0.2f, 0.4f, 0.6f));
  const Vec2 u{0.3f, 0.8f};
  const auto expectSame = [&](const Bsdf& held, const auto& model) {
    const BsdfSample a = held.sample(wo, u, 0.6f), b = model.sample(wo, u, 0.6f);
    EXPECT_EQ(a.wi, b.wi);
    EXPECT_EQ(a.weight, b.weight);
    EXPECT_FLOAT_EQ(a.pdf, b.pdf);
    EXPECT_EQ(a.specular, held.specular());
    if constexpr (requires { model.value(wo, wi); }) {
      EXPECT_EQ(held.value(wo, wi), model.value(wo, wi));
      EXPECT_FLOAT_EQ(held.pdf(wo, wi), model.pdf(wo, wi));
    } else {
      EXPECT_TRUE(held.specular() && isBlack(held.value(wo, wi)) && held.pdf(wo, wi) == 0);
    }
  };
  const Diffuse diffuse{Rgb(0.2f, 0.5f, 1)};
  const Phong phong{Rgb(0.1f), Rgb(0.7f), 20};
  const Conductor conductor{Rgb(0.2f), Rgb(3.f), Rgb(1.f)};
  const Dielectric dielectric{1.5f, Rgb(1.f), Rgb(0.5f)};
  expectSame(Bsdf(diffuse), diffuse);
  expectSame(Bsdf(phong), phong);
  expectSame(Bsdf(conductor), conductor);
  expectSame(Bsdf(dielectric), dielectric);
  EXPECT_TRUE(Bsdf(dielectric).transmits());
  EXPECT_FALSE(Bsdf(conductor).transmits());
}

}  // namespace
}  // namespace virga
