// SPDX-License-Identifier: Apache-2.0
// `ims` against exact numbers: slabs by adding-doubling, and white furnaces.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "methods/ims_checks.h"

namespace virga {
namespace {

using namespace virga::testing;

const SettingValues kByPath = {{"compensation", "path"}}, kSampled = {{"compensation", "sampled"}};

// --- slabs ---

/// Radiance that a slab of optical thickness `thickness` reflects and transmits at a cosine, under normal incidence of
/// irradiance 1; by adding-doubling (exact_test.cpp holds `path` against the same table).
struct Slab {
  double albedo, g, thickness, cosine, reflected, transmitted;
};
constexpr Slab kSlabs[] = {
    {0.5, 0, 1, 0.6, 0.032463, 0.026213}, {0.9, 0, 2, 1.0, 0.100411, 0.072819}, {1, 0, 1, 0.4, 0.130197, 0.105836}};

/// A slab 16 mean free paths wide of which 2 in the middle are seen, from afar: virtual lights all over them light the
/// picture, where those that happen to lie near one point would do it alone. What is missing beyond the slab's sides
/// would bring less than 0.3 %.
std::string slabScene(const Slab& slab, bool reflected) {
  constexpr double kDistance = 2000, kSeen = 2, kHalf = 8;
  const double sine = std::sqrt(1 - slab.cosine * slab.cosine), side = reflected ? 1 : -1;
  return fmt::format(R"(<sensor type="perspective"><float name="fov" value="{}"/><transform name="to_world">
      <lookat origin="{}, 0, {}" target="0, 0, {}" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/></film></sensor>
    <emitter type="directional"><vector name="direction" x="0" y="0" z="-1"/><rgb name="irradiance" value="1"/></emitter>
    <shape type="cube"><transform name="to_world"><scale x="{}" y="{}" z="{}"/></transform><bsdf type="null"/>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="1"/><float name="albedo" value="{}"/>
      <phase type="hg"><float name="g" value="{}"/></phase></medium></shape>)",
                     2 * std::atan(0.5 * kSeen / kDistance) * 180 / M_PI, kDistance * sine,
                     side * (0.5 * slab.thickness + kDistance * slab.cosine), side * 0.5 * slab.thickness, kHalf, kHalf,
                     0.5 * slab.thickness, slab.albedo, slab.g);
}

/// Beauty, one mean a replicate.
stats::Moments beautyOf(const SceneSnapshot& scene, SettingValues settings, const Trials& trials) {
  stats::Moments m;
  for (int s = 0; s < trials.sets; ++s) {
    const RenderSession session = rendered(scene, {.passes = Film::kReplicates * trials.passes,
                                                   .seed = trials.seed * 1000 + static_cast<uint64_t>(s),
                                                   .method = "ims",
                                                   .settings = settings});
    EXPECT_EQ(session.film().nonFiniteSamples(), 0u);
    for (int r = 0; r < Film::kReplicates; ++r) m.add(pixelMoments(session.film().replicateBeauty(r)).mean());
  }
  return m;
}

// The radius is half a mean free path.
TEST(ImsExact, SlabsAgreeWithAddingDoubling) {
  for (const Slab& slab : kSlabs)
    for (SettingValues settings : {kByPath, kSampled})
      for (const bool reflected : {true, false}) {
        settings.insert({{"walks", "2048"}, {"radius", "0.5"}, {"lights", "24"}});
        const stats::Moments m = beautyOf(sceneOf(slabScene(slab, reflected)), settings, {.sets = 24});
        const double exact = reflected ? slab.reflected : slab.transmitted;
        const std::string name = fmt::format("albedo {} g {} mu {} {} {}", slab.albedo, slab.g, slab.cosine,
                                             reflected ? "reflected" : "transmitted", settings["compensation"]);
        fmt::print("{:48} {:+.2f} %, +- {:.2f} %\n", name, 100 * (m.mean() / exact - 1),
                   100 * m.standardError() / exact);
        EXPECT_NEAR(m.mean(), exact, 3.5 * m.standardError() + 0.003 * exact) << name;
        EXPECT_LT(m.standardError(), 0.012 * exact) << name << ": too few samples to tell";
      }
}

TEST(ImsExact, WithoutCompensationASlabIsDarker) {
  const Slab& slab = kSlabs[1];
  const stats::Moments m =
      beautyOf(sceneOf(slabScene(slab, true)),
               {{"compensation", "none"}, {"walks", "2048"}, {"radius", "0.5"}, {"lights", "24"}}, {.sets = 12});
  EXPECT_LT(m.mean(), slab.reflected - 4 * m.standardError());
}

// --- furnaces ---

constexpr const char* kFurnace = R"(<sensor type="perspective"><float name="fov" value="30"/>
  <transform name="to_world"><lookat origin="0.3, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
  <film type="hdrfilm"><integer name="width" value="20"/><integer name="height" value="20"/></film></sensor>
  <emitter type="constant"><rgb name="radiance" value="1"/></emitter>)";

std::string cloud(const char* albedo, const char* g) {
  return fmt::format(R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous">
    <float name="sigma_t" value="1.5"/><float name="albedo" value="{}"/><phase type="hg"><float name="g" value="{}"/></phase>
    </medium></shape>)",
                     albedo, g);
}
const std::string kBall = R"(<shape type="sphere"><float name="radius" value="0.5"/><bsdf type="diffuse">
  <rgb name="reflectance" value="1"/></bsdf></shape>)";
const std::string kGlass = R"(<shape type="sphere"><float name="radius" value="0.4"/>
  <point name="center" x="0.5" y="0.5" z="0.6"/><bsdf type="dielectric"/></shape>)";
const std::string kWhiteBoard =
    R"(<shape type="disk"><transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/>
  <translate y="-1"/></transform><bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf></bsdf></shape>)";

stats::Moments furnace(const std::string& elements, SettingValues settings) {
  settings.insert({{"walks", "1024"}, {"radius", "0.4"}, {"lights", "8"}});
  return beautyOf(sceneOf(kFurnace + elements), settings, {.sets = 16});
}

TEST(ImsFurnace, IsWhite) {
  const std::string scenes[] = {cloud("1", "0"), cloud("1", "0.6"), kBall + kWhiteBoard,
                                cloud("1", "0") + kBall + kGlass + kWhiteBoard};
  for (const std::string& elements : scenes)
    for (const SettingValues& settings : {kByPath, kSampled}) {
      const stats::Moments m = furnace(elements, settings);
      fmt::print("{:.4f} +- {:.4f}\n", m.mean(), m.standardError());
      EXPECT_NEAR(m.mean(), 1, 4 * m.standardError() + 1e-5) << elements;
      EXPECT_LT(m.standardError(), 8e-3) << "too few samples to tell: " << elements;
    }
}
TEST(ImsFurnace, LessThanWhiteIsNoticed) {
  const stats::Moments grey = furnace(cloud("0.95", "0"), kByPath);
  EXPECT_LT(grey.mean(), 1 - 4 * grey.standardError());
  const stats::Moments clamped = furnace(cloud("1", "0"), {{"compensation", "none"}});
  EXPECT_LT(clamped.mean(), 1 - 4 * clamped.standardError());
}

}  // namespace
}  // namespace virga
