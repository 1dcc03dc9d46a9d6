// SPDX-License-Identifier: Apache-2.0
#include "image/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "core/error.h"
#include "image/film.h"
#include "scratch.h"

namespace virga {
namespace {

TEST(Metrics, AgreesWithHandComputedValues) {
  Image a(2, 1), b(2, 1);
  a.at(0, 0) = {1, 2, 0.5f};
  b.at(0, 0) = {0, 2, 1};
  a.at(1, 0) = {3, 0, 0};
  b.at(1, 0) = {2, 0, 0};
  // Squares of the differences 1, 0, -0.5, 1, 0, 0 over b^2 + 0.01 = 0.01, 4.01, 1.01, 4.01, 0.01, 0.01.
  const Metrics m = compare(a, b);
  EXPECT_DOUBLE_EQ(m.mse, 2.25 / 6);
  EXPECT_DOUBLE_EQ(m.relMse, (1 / 0.01 + 0.25 / 1.01 + 1 / 4.01) / 6);
  EXPECT_DOUBLE_EQ(m.mape, (1 / 0.01 + 0.5 / 1.01 + 1 / 2.01) / 6);
  EXPECT_DOUBLE_EQ(m.bias, (1 / 0.01 - 0.5 / 1.01 + 1 / 2.01) / 6);
  EXPECT_DOUBLE_EQ(m.excess, 1.5 / 5);
  EXPECT_DOUBLE_EQ(m.maxAbs, 1);
  EXPECT_DOUBLE_EQ(m.psnr, 10 * std::log10(4 / (2.25 / 6)));
  EXPECT_EQ(m.pixels, 2);
  EXPECT_EQ(m.nonFinite + m.referenceNonFinite, 0);
}

TEST(Metrics, EqualPicturesHaveNoError) {
  for (const Rgb value : {Rgb(0), Rgb(3, 0, 1e20f)}) {
    const Metrics m = compare(Image(5, 4, value), Image(5, 4, value));
    EXPECT_EQ(m.mse, 0);
    EXPECT_EQ(m.relMse, 0);
    EXPECT_EQ(m.bias, 0);
    EXPECT_EQ(m.excess, 0);
    EXPECT_EQ(m.psnr, std::numeric_limits<double>::infinity());
  }
}

TEST(Metrics, NonFinitePixelsAreCountedAndLeftOut) {
  Image a(3, 1, Rgb(1)), b(3, 1, Rgb(2));
  a.at(0, 0).g = std::nanf("");
  b.at(0, 0).r = kInfinity;
  b.at(2, 0).b = -kInfinity;
  const Metrics m = compare(a, b);
  EXPECT_EQ(m.pixels, 1);
  EXPECT_EQ(m.nonFinite, 1);
  EXPECT_EQ(m.referenceNonFinite, 2);
  EXPECT_EQ(m.mse, 1);
  EXPECT_NE(errorOf([] { compare(Image(1, 1, Rgb(std::nanf(""))), Image(1, 1)); }).find("no pixel"), std::string::npos);
}

TEST(Metrics, DifferentSizesAreAnError) {
  const Image a(4, 3), b(3, 4);
  EXPECT_NE(errorOf([&] { compare(a, b); }).find("4 x 3 and 3 x 4"), std::string::npos);
  EXPECT_NE(errorOf([&] { signedDifference(a, b); }).find("differ in size"), std::string::npos);
  EXPECT_NE(errorOf([&] { testAgreement(a, {a}, a, {b}); }).find("differ in size"), std::string::npos);
}

// Closed forms: n = 1 is Cauchy's law, n = 2 is algebraic; and the normal law in the limit.
TEST(Student, FollowsClosedForms) {
  for (const double t : {1e-6, 0.1, 0.7, 1.0, 2.0, 3.0, 10.0, 1e3}) {
    EXPECT_NEAR(studentTwoSided(t, 1) / (2 / std::numbers::pi * std::atan(1 / t)), 1, 1e-10) << t;
    EXPECT_NEAR(studentTwoSided(t, 2) / (2 / (2 + t * t + t * std::sqrt(2 + t * t))), 1, 1e-10) << t;
  }
  for (const double t : {0.5, 2.0, 3.0}) EXPECT_NEAR(studentTwoSided(t, 1e7), std::erfc(t / std::sqrt(2)), 1e-6);
  EXPECT_EQ(studentTwoSided(0, 5), 1);
  EXPECT_EQ(studentTwoSided(std::numeric_limits<double>::infinity(), 5), 0);
}

TEST(Agreement, AgreesWithHandComputedValues) {
  Image a(2, 1), b(2, 1), va(2, 1), vb(2, 1);
  a.at(0, 0) = {3, 1, 7};
  b.at(0, 0) = {1, 1, 8};  // a difference without any variance
  va.at(0, 0) = {0.5f, 0.25f, 0};
  vb.at(0, 0) = {0.5f, 0, 0};
  a.at(1, 0).g = std::nanf("");
  const Agreement test = testAgreement(a, {va, 3}, b, {vb, 3});
  EXPECT_EQ(test.tests, 2);  // t = 2 with 4 degrees of freedom, t = 0 with 2
  EXPECT_EQ(test.certain, 1);
  EXPECT_EQ(test.nonFinite, 1);
  EXPECT_NEAR(test.maximumT, 2, 1e-9);
  EXPECT_NEAR(test.chiSquaredPerDof, 4 * (4.0 - 2) / 4, 1e-9);
  EXPECT_EQ(test.beyond3, 0);
  const double p = studentTwoSided(2, 4);
  EXPECT_NEAR(test.expectedBeyond2, (p + studentTwoSided(2, 2)) / 2, 1e-12);
  EXPECT_NEAR(test.maximumP, 1 - (1 - p) * (1 - p), 1e-9);
}

TEST(Agreement, PicturesWithoutNoiseThatAreEqualAgree) {
  const Image picture(3, 3, Rgb(0.1f)), none(3, 3), nearly(3, 3, Rgb(0.1f * (1 + 2e-7f)));
  const Agreement test = testAgreement(picture, {none}, nearly, {none});
  EXPECT_EQ(test.tests, 0);
  EXPECT_EQ(test.certain, 0);
  EXPECT_EQ(test.maximumP, 1);
}

struct Rendered {
  Image beauty, variance;
};

Rendered noisy(unsigned seed, float sigma, const std::function<float(int, int)>& expectation) {
  Film film(160, 120, LayerMask::none());
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0, sigma);
  for (int r = 0; r < Film::kReplicates; ++r) {
    for (int y = 0; y < film.height(); ++y)
      for (int x = 0; x < film.width(); ++x) {
        LayerRadiance radiance;
        for (int c = 0; c < 3; ++c) radiance.value[0][c] = expectation(x, y) + noise(random);
        film.frame().set(x, y, radiance);
      }
    film.average(r);
  }
  return {film.beauty(), film.beautyVariance()};
}

// What the test claims where pictures agree, what it must see where they do not.
TEST(Agreement, HoldsItsLevelAndHasPower) {
  const auto scene = [](int x, int y) { return 1 + 0.01f * static_cast<float>(x + y); };
  const Rendered a = noisy(1, 0.3f, scene);
  for (const float sigma : {0.3f, 0.1f, 0.003f}) {  // equal, unequal, negligible noise of the reference
    const Rendered b = noisy(2, sigma, scene);
    const Agreement same = testAgreement(a.beauty, {a.variance}, b.beauty, {b.variance});
    EXPECT_EQ(same.tests, 3 * 160 * 120);
    EXPECT_NEAR(same.chiSquaredPerDof, 1, 0.03) << sigma;
    EXPECT_NEAR(same.beyond2 / same.expectedBeyond2, 1, 0.1) << sigma;
    EXPECT_NEAR(same.beyond3 / same.expectedBeyond3, 1, 0.25) << sigma;
    EXPECT_GT(same.maximumP, 1e-3) << sigma;
  }
  const Rendered onePixel =
      noisy(3, 0.3f, [&](int x, int y) { return scene(x, y) * (x == 50 && y == 60 ? 30.f : 1.f); });
  EXPECT_LT(testAgreement(onePixel.beauty, {onePixel.variance}, a.beauty, {a.variance}).maximumP, 1e-3);
  const Rendered brighter = noisy(4, 0.3f, [&](int x, int y) { return 1.05f * scene(x, y); });
  EXPECT_GT(testAgreement(brighter.beauty, {brighter.variance}, a.beauty, {a.variance}).chiSquaredPerDof, 1.05);
}

TEST(SignedDifference, IsGreenWhereTooDarkAndRedWhereTooBright) {
  Image a(4, 1), b(4, 1);
  a.at(0, 0) = {1, 0, 0.5f}, b.at(0, 0) = {0, 0, 0};  // mean difference 0.5: too bright
  a.at(1, 0) = Rgb(1), b.at(1, 0) = Rgb(1.25f);       // too dark
  a.at(3, 0).r = std::nanf("");
  const Image picture = signedDifference(a, b);
  EXPECT_EQ(picture.at(0, 0), Rgb(1, 0, 0));
  EXPECT_EQ(picture.at(1, 0), Rgb(0, 0.5f, 0));
  EXPECT_EQ(picture.at(2, 0), Rgb(0, 0, 0));
  EXPECT_FALSE(isFinite(picture.at(3, 0)));
  EXPECT_EQ(signedDifference(a, b, {.gain = 4}).at(1, 0), Rgb(0, 1, 0));
}

}  // namespace
}  // namespace virga
