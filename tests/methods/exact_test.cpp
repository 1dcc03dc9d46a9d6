// SPDX-License-Identifier: Apache-2.0
// Radiance of plane-parallel slabs and of a point light in infinite fog, against exact numbers.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

/// Radiance that a slab reflects and transmits under normal incidence of irradiance 1, at the cosines below. By
/// adding-doubling, which reproduces van de Hulst's published reflectance and transmittance for albedo 0.9, g 0.75,
/// thickness 2.
struct Slab {
  double albedo, g, thickness;
  std::array<double, 5> reflected, transmitted;
};
constexpr std::array<double, 5> kCosines = {1.0, 0.8, 0.6, 0.4, 0.2};
constexpr Slab kSlabs[] = {
    {0.5, 0, 1, {0.024375, 0.027915, 0.032463, 0.038212, 0.044589}, {0.02137, 0.023713, 0.026213, 0.028133, 0.026981}},
    {0.9, 0, 2, {0.100411, 0.109303, 0.118739, 0.127594, 0.133291}, {0.072819, 0.073905, 0.072357, 0.066228, 0.05468}},
    {0.99, 0, 4, {0.197359, 0.20409, 0.209058, 0.210733, 0.206003}, {0.097826, 0.090011, 0.079579, 0.067087, 0.053385}},
    {1, 0, 1, {0.085749, 0.097658, 0.112537, 0.130197, 0.145779}, {0.078473, 0.087486, 0.097414, 0.105836, 0.103444}},
    {0.9, 0.75, 2, {0.01967, 0.026144, 0.034016, 0.041629, 0.044663}, {0.764807, 0.15008, 0.099854, 0.079683, 0.06277}},
    {0.99,
     0.5,
     8,
     {0.191423, 0.194817, 0.194502, 0.188328, 0.172263},
     {0.099784, 0.086142, 0.073194, 0.060194, 0.04666}},
    {0.95,
     0.85,
     4,
     {0.02628, 0.034256, 0.042535, 0.0484, 0.047678},
     {1.02638, 0.177196, 0.118459, 0.091835, 0.069417}}};

/// Relative standard error that every comparison reaches.
constexpr double kPrecision = 0.0045;

/// A z-test at 3 standard errors of at most 0.45 %; a miss is tried once more with an independent seed and four times
/// the samples, so that the whole table fails by chance less than once in a thousand seeds. `estimate(passes, seed)`;
/// as many passes as a pilot run says are needed.
template <class Estimate>
void expectAgreement(double exact, const Estimate& estimate, const std::string& name) {
  constexpr int kPilot = 16;
  const auto misses = [&](const stats::Moments& m) { return std::fabs(m.mean() - exact) > 3 * m.standardError(); };
  const double pilotError = estimate(kPilot, 3).standardError();
  const int passes = kPilot * static_cast<int>(std::ceil(1.1 * std::pow(pilotError / (kPrecision * exact), 2)));
  stats::Moments m = estimate(passes, 1);
  if (misses(m)) m = estimate(4 * passes, 2);
  EXPECT_LE(m.standardError(), 0.005 * exact) << name << ": too few samples to tell";
  EXPECT_FALSE(misses(m)) << name << ": " << m.mean() << " +- " << m.standardError() << ", exact " << exact << ", z "
                          << (m.mean() - exact) / m.standardError();
}

constexpr int kFilm = 64;

std::string slabScene(const Slab& slab, double cosine, bool reflected) {
  constexpr double kDistance = 50;
  const double sine = std::sqrt(1 - cosine * cosine), side = reflected ? 1 : -1;
  const std::string origin =
      fmt::format("{}, 0, {}", kDistance * sine, side * (0.5 * slab.thickness + kDistance * cosine));
  const std::string target = fmt::format("0, 0, {}", side * 0.5 * slab.thickness);
  return pinpointSensor(origin, target, "0, 1, 0", kFilm) + fmt::format(R"(
    <emitter type="directional"><vector name="direction" x="0" y="0" z="-1"/><rgb name="irradiance" value="1"/></emitter>
    <shape type="cube">
      <transform name="to_world"><scale x="400" y="400" z="{}"/></transform><bsdf type="null"/>
      <medium name="interior" type="homogeneous">
        <float name="sigma_t" value="1"/><float name="albedo" value="{}"/><phase type="hg"><float name="g" value="{}"/></phase>
      </medium>
    </shape>)",
                                                                        0.5 * slab.thickness, slab.albedo, slab.g);
}

class SlabTest : public ::testing::TestWithParam<Slab> {};

TEST_P(SlabTest, PathAgreesWithAddingDoubling) {
  const Slab& slab = GetParam();
  for (const bool reflected : {true, false})
    for (size_t i = 0; i < kCosines.size(); ++i) {
      const SceneSnapshot scene = sceneOf(slabScene(slab, kCosines[i], reflected));
      const double exact = reflected ? slab.reflected[i] : slab.transmitted[i];
      expectAgreement(
          exact,
          [&](int passes, uint64_t seed) {
            return pixelMoments(rendered(scene, {.passes = passes, .seed = seed}).film().beauty());
          },
          fmt::format("albedo {} g {} thickness {} mu {} {}", slab.albedo, slab.g, slab.thickness, kCosines[i],
                      reflected ? "reflected" : "transmitted"));
    }
}

INSTANTIATE_TEST_SUITE_P(Exact, SlabTest, ::testing::ValuesIn(kSlabs), [](const auto& slab) {
  return fmt::format("albedo{}g{}thickness{}", std::lround(slab.param.albedo * 100), std::lround(slab.param.g * 100),
                     std::lround(slab.param.thickness));
});

TEST(SlabTestItself, NoticesOnePercentOfAlbedo) {
  Slab wrong = kSlabs[1];
  wrong.albedo += 0.01;
  const SceneSnapshot scene = sceneOf(slabScene(wrong, 1, true));
  const stats::Moments m = pixelMoments(rendered(scene, {.passes = 40}).film().beauty());
  EXPECT_GT(std::fabs(m.mean() - kSlabs[1].reflected[0]), 3 * m.standardError());
}

/// Single scattering of a point light of intensity 1 in isotropic fog, along a ray from `from` to `to`, measured from
/// the point that is closest to the light.
struct Airlight {
  double sigmaS, sigmaA, distance, from, to, radiance;
};
constexpr Airlight kAirlights[] = {{0.2, 0.0, 1.0, -4, 6, 0.014503438455866746},
                                   {0.5, 0.1, 0.5, -3, 5, 0.024783555972589837},
                                   {1.5, 0.3, 0.25, -2, 2, 0.021769767970806705}};

std::string airlightScene(const Airlight& a) {
  const double sigmaT = a.sigmaS + a.sigmaA;
  const std::string clip = fmt::format(R"(<float name="near_clip" value="0"/><float name="far_clip" value="{}"/>
    <ref name="medium" id="fog"/>)",
                                       a.to - a.from);
  return fmt::format(
             R"(<medium type="homogeneous" id="fog"><float name="sigma_t" value="{}"/><float name="albedo" value="{}"/>
      </medium><emitter type="point"><point name="position" x="0" y="{}" z="0"/></emitter>)",
             sigmaT, a.sigmaS / sigmaT, a.distance) +
         pinpointSensor(fmt::format("{}, 0, 0", a.from), fmt::format("{}, 0, 0", a.from + 1), "0, 1, 0", kFilm, clip);
}

TEST(Airlight, SingleScatteringAgreesWithQuadrature) {
  for (const Airlight& a : kAirlights)
    for (const char* equiangular : {"1", "0"}) {
      const SceneSnapshot scene = sceneOf(airlightScene(a));
      expectAgreement(
          a.radiance,
          [&](int passes, uint64_t seed) {
            const RenderSession session =
                rendered(scene, {.passes = passes,
                                 .seed = seed,
                                 .layers = LayerMask::all(),
                                 .settings = {{"equiangular_depth", equiangular}, {"max_depth", "2"}}});
            return pixelMoments(session.film().layer(Layer::directMedia));
          },
          fmt::format("sigma_s {} equiangular depth {}", a.sigmaS, equiangular));
    }
}

// Sheets are not closed: each one that is passed says which medium follows.
TEST(Exact, TwoSheetsBoundASlab) {
  const std::string medium = R"(<medium type="homogeneous" id="s"><float name="sigma_t" value="0.5"/>
    <float name="albedo" value="0"/></medium>)";
  const auto sheet = [](const char* transform) {
    return fmt::format(R"(<shape type="rectangle"><transform name="to_world"><scale value="10"/>{}</transform>
      <bsdf type="null"/><ref id="s" name="interior"/></shape>)",
                       transform);
  };
  const std::string sheets = medium + sheet(R"(<translate z="1"/>)") +
                             sheet(R"(<rotate x="1" angle="180"/><translate z="-1"/>)") +
                             R"(<emitter type="constant"/>)";
  for (const char* eye : {"0, 0, 5", "0, 0, -5"}) {
    const RenderSession session =
        rendered(sceneOf(pinpointSensor(eye, "0, 0, 0", "0, 1, 0", 16) + sheets), {.passes = 256});
    const stats::Moments m = pixelMoments(session.film().beauty());
    EXPECT_NEAR(m.mean(), std::exp(-1.0), 4 * m.standardError()) << eye;
    EXPECT_LT(m.standardError(), 4e-3);
  }
}

// A sphere of radiance L that is wholly above the horizon sends the irradiance pi L (r / d)^2 cos(theta), however near
// it is and wherever the coordinates have their origin.
TEST(Exact, SphereLightOverAFloor) {
  const double radius = 0.9, height = 2.25;
  for (const double offset : {0.0, 3.0, -300.0})
    for (const double side : {0.0, 0.7, 3.0}) {
      const auto at = [&](double x, double y, double z) {
        return fmt::format("{}, {}, {}", x + offset, y, z - offset);
      };
      const std::string scene = pinpointSensor(at(side + 1, 2, 4), at(side, 0, 0), "0, 1, 0", 16) +
                                fmt::format(R"(
        <shape type="sphere"><transform name="to_world"><scale value="{}"/><translate value="{}"/></transform>
        <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/><translate value="{}"/></transform>
        </shape>)",
                                            radius, at(0, height, 0), at(0, 0, 0));
      const stats::Moments m = pixelMoments(rendered(sceneOf(scene), {.passes = 64}).film().beauty());
      const double d = std::hypot(height, side), exact = 0.5 * 5 * std::pow(radius / d, 2) * height / d;
      EXPECT_NEAR(m.mean() / exact, 1, std::max(4 * m.standardError() / exact, 1e-3))
          << "offset " << offset << ", side " << side;
      EXPECT_LT(m.standardError() / exact, 2e-3);
    }
}

}  // namespace
}  // namespace virga
