// SPDX-License-Identifier: Apache-2.0
#include "scattering/fresnel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

namespace virga {
namespace {

// Fresnel's equations for a complex index, in double precision: the mean over both polarisations.
double reference(double cosine, std::complex<double> index) {
  const std::complex<double> transmitted = std::sqrt(1.0 - (1 - cosine * cosine) / (index * index));
  const double perpendicular = std::norm((cosine - index * transmitted) / (cosine + index * transmitted));
  const double parallel = std::norm((index * cosine - transmitted) / (index * cosine + transmitted));
  return 0.5 * (perpendicular + parallel);
}

constexpr float kCosines[] = {1e-4f, 1e-3f, 0.01f, 0.1f, 0.3f, 0.5f, 0.7f, 0.9f, 0.99f, 1.f};

TEST(FresnelDielectric, AgreesWithFresnelsEquations) {
  for (float eta : {1.33f, 1.5f, 2.4f, 0.75f, 1.0001f, 1.f})
    for (float c : kCosines)
      for (float side : {1.f, -1.f}) {
        const double relative = side > 0 ? static_cast<double>(eta) : 1 / static_cast<double>(eta);
        const double expected = reference(static_cast<double>(c), relative);
        EXPECT_NEAR(fresnelDielectric(side * c, eta).reflectance, expected, 2e-6 + 1e-3 * (eta == 1.0001f))
            << eta << " " << c;
      }
}

TEST(FresnelDielectric, NormalIncidence) {
  for (float eta : {1.33f, 1.5f, 2.4f, 0.75f})
    for (float side : {1.f, -1.f}) {
      const DielectricFresnel f = fresnelDielectric(side, eta);
      EXPECT_NEAR(f.reflectance, square((eta - 1) / (eta + 1)), 1e-7);
      EXPECT_EQ(f.cosTransmitted, 1);
      EXPECT_EQ(f.eta, side > 0 ? eta : 1 / eta);
    }
}

TEST(FresnelDielectric, BrewstersAngleHasNoParallelPart) {
  for (float eta : {1.33f, 1.5f, 2.4f}) {
    // tan(theta) = eta, and the refracted ray is at a right angle to the reflected one.
    const float c = 1 / std::sqrt(1 + eta * eta);
    const DielectricFresnel f = fresnelDielectric(c, eta);
    EXPECT_NEAR(f.cosTransmitted, eta * c, 1e-6);
    EXPECT_NEAR(f.reflectance, 0.5f * square((1 - eta * eta) / (1 + eta * eta)), 1e-6);
  }
}

TEST(FresnelDielectric, TotalReflectionBeginsAtTheCriticalAngle) {
  for (float eta : {1.33f, 1.5f, 2.4f}) {
    const float critical = std::sqrt(1 - 1 / (eta * eta));
    EXPECT_EQ(fresnelDielectric(-(critical - 1e-4f), eta).reflectance, 1);
    EXPECT_EQ(fresnelDielectric(-(critical - 1e-4f), eta).cosTransmitted, 0);
    EXPECT_LT(fresnelDielectric(-(critical + 1e-4f), eta).reflectance, 0.95f);
    EXPECT_LT(fresnelDielectric(critical - 1e-4f, eta).reflectance, 0.5f) << "not from the outside";
  }
}

TEST(FresnelDielectric, BothSidesOfOneRayReflectTheSame) {
  for (float eta : {1.33f, 1.5f, 0.6f})
    for (float c : kCosines) {
      const DielectricFresnel out = fresnelDielectric(c, eta);
      // Nearer to grazing, the refracted cosine does not hold the digits that tell the angle.
      if (out.cosTransmitted == 0 || c < 0.01f) continue;
      const DielectricFresnel in = fresnelDielectric(-out.cosTransmitted, eta);
      EXPECT_NEAR(in.reflectance, out.reflectance, 2e-4) << eta << " " << c;
    }
}

TEST(FresnelDielectric, EqualIndicesReflectNothing) {
  for (float c : kCosines)
    for (float side : {1.f, -1.f}) {
      EXPECT_EQ(fresnelDielectric(side * c, 1).reflectance, 0) << c;
      EXPECT_NEAR(fresnelDielectric(side * c, 1).cosTransmitted, c, 1e-7f * c) << c;
    }
}

TEST(FresnelConductor, AgreesWithFresnelsEquations) {
  for (auto [eta, k] :
       {std::pair(0.143f, 3.983f), {1.442f, 1.603f}, {0.2f, 7.f}, {2.9f, 3.1f}, {1.5f, 0.f}, {0.5f, 0.1f}})
    for (float c : kCosines) {
      const double expected = reference(static_cast<double>(c), {static_cast<double>(eta), static_cast<double>(k)});
      EXPECT_NEAR(fresnelConductor(c, eta, k), expected, 5e-6) << eta << " " << k << " " << c;
    }
}

TEST(FresnelConductor, Limits) {
  for (float c : kCosines) EXPECT_EQ(fresnelConductor(c, 0, 1), 1) << "perfect mirror at " << c;
  EXPECT_NEAR(fresnelConductor(1, 0.2f, 3), (square(0.2f - 1) + 9) / (square(0.2f + 1) + 9), 1e-6);
  EXPECT_NEAR(fresnelConductor(0, 0.2f, 3), 1, 1e-6) << "grazing";
  const Rgb gold = fresnelConductor(0.7f, Rgb(0.143f, 0.374f, 1.442f), Rgb(3.983f, 2.385f, 1.603f));
  EXPECT_EQ(gold, Rgb(fresnelConductor(0.7f, 0.143f, 3.983f), fresnelConductor(0.7f, 0.374f, 2.385f),
                      fresnelConductor(0.7f, 1.442f, 1.603f)));
}

}  // namespace
}  // namespace virga
