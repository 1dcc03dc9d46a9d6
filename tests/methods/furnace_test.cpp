// SPDX-License-Identifier: Apache-2.0
// White furnace: with albedo 1, reflectance 1 and a constant environment of 1, radiance is 1 everywhere.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "methods/ims_scenes.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr const char* kSensor = R"(<sensor type="perspective"><float name="fov" value="50"/>
  <transform name="to_world"><lookat origin="0.3, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
  <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="48"/></film></sensor>
  <emitter type="constant"><rgb name="radiance" value="1"/></emitter>)";

std::string cloud(const std::string& albedo, const std::string& g = "0.7") {
  return R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><float name="sigma_t" value="2"/>
    <float name="albedo" value=")" +
         albedo + R"("/><phase type="hg"><float name="g" value=")" + g + R"("/></phase></medium></shape>)";
}

std::string cloudOf(const std::string& phase) {
  return R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><float name="sigma_t" value="2"/>
    <float name="albedo" value="1"/>)" +
         phase + "</medium></shape>";
}

// Mean radiance, to within its standard error.
stats::Moments furnace(const std::string& elements, int passes = 64) {
  return pixelMoments(rendered(sceneOf(kSensor + elements), {.passes = passes}).film().beauty());
}

void expectWhite(const std::string& elements) {
  const stats::Moments m = furnace(elements);
  EXPECT_NEAR(m.mean(), 1, std::max(4 * m.standardError(), 1e-5)) << elements;
  EXPECT_LT(m.standardError(), 4e-3) << "too few samples to tell";
}

TEST(Furnace, EmptySceneIsWhite) { expectWhite(""); }
TEST(Furnace, MediumIsWhite) { expectWhite(cloud("1")); }
TEST(Furnace, SmokeOnAGridIsWhite) {
  const std::string scene = plume(8), albedo = R"(<rgb name="albedo" value="0.9"/>)";
  std::string smoke =
      scene.substr(scene.find(R"(<shape type="cube"><transform name="to_world"><scale value="0.95"/>)"));
  smoke.replace(smoke.find(albedo), albedo.size(), R"(<rgb name="albedo" value="1"/>)");
  expectWhite(smoke);
}
TEST(Furnace, BackwardMediumIsWhite) { expectWhite(cloud("1", "-0.8")); }
TEST(Furnace, CornetteShanksIsWhite) {
  expectWhite(cloudOf(R"(<phase type="cornette_shanks"><float name="g" value="0.5"/></phase>)"));
}
TEST(Furnace, RayleighIsWhite) { expectWhite(cloudOf(R"(<phase type="rayleigh"/>)")); }
TEST(Furnace, SchlickIsWhite) {
  expectWhite(cloudOf(R"(<phase type="schlick"><float name="g" value="0.6"/></phase>)"));
}
TEST(Furnace, TableIsWhite) {
  expectWhite(cloudOf(R"(<phase type="tabphase"><string name="values" value="0, 1, 0, 0.5, 8"/></phase>)"));
}
TEST(Furnace, BlendIsWhite) {
  expectWhite(cloudOf(R"(<phase type="blendphase"><float name="weight" value="0.3"/><phase type="hg"/>
    <phase type="cornette_shanks"><float name="g" value="-0.5"/></phase></phase>)"));
}
// Hundreds of events a path: Russian roulette must not make up weights where nothing is absorbed.
TEST(Furnace, ThickMediumIsWhite) {
  for (const char* sigmaT : {"25", "100"}) {
    const stats::Moments m = furnace(
        fmt::format(
            R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><float name="sigma_t" value="{}"/>
        <float name="albedo" value="1"/></medium></shape>)",
            sigmaT),
        32);
    EXPECT_NEAR(m.mean(), 1, 4 * m.standardError()) << sigmaT;
    EXPECT_LT(m.standardError(), 6e-3) << "a tail of large weights";
  }
}
TEST(Furnace, DiffuseObjectsAreWhite) {
  expectWhite(R"(<shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf></shape>
    <shape type="disk"><transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/><translate y="-1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf></shape>)");
}
TEST(Furnace, GlassAndMirrorAreWhite) {
  expectWhite(
      R"(<shape type="sphere"><transform name="to_world"><translate x="-0.8"/></transform><bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="1.2" y="0" z="0"/><bsdf type="conductor"><string name="material" value="none"/>
    </bsdf></shape>)");
}
TEST(Furnace, HardlyRoughAndThinObjectsAreWhite) {
  expectWhite(
      R"(<shape type="sphere"><transform name="to_world"><translate x="-1.2"/></transform><bsdf type="roughdielectric">
    <float name="alpha" value="0.001"/></bsdf></shape><shape type="sphere"><point name="center" x="1.2" y="0" z="0"/>
    <bsdf type="roughconductor"><float name="alpha" value="0.001"/></bsdf></shape>
    <shape type="cylinder"><float name="radius" value="0.4"/><bsdf type="thindielectric"/></shape>)");
}
// A furnace shows what single scattering off rough facets loses, and that it never gains.
TEST(Furnace, RoughObjectsAreAtMostWhite) {
  for (const char* bsdf : {"roughconductor", "roughdielectric"})
    for (const char* distribution : {"beckmann", "ggx"}) {
      const stats::Moments m = furnace(std::string(R"(<shape type="sphere"><bsdf type=")") + bsdf +
                                       R"("><float name="alpha" value="0.5"/><string name="distribution" value=")" +
                                       distribution + R"("/></bsdf></shape>)");
      EXPECT_LT(m.mean(), 1 - 4 * m.standardError()) << bsdf << " " << distribution;
      EXPECT_GT(m.mean(), 0.9) << bsdf << " " << distribution;
    }
}
TEST(Furnace, ObjectsInMediumAreWhite) {
  expectWhite(cloud("1") + R"(<shape type="sphere"><float name="radius" value="0.5"/><bsdf type="diffuse">
    <rgb name="reflectance" value="1"/></bsdf></shape><shape type="sphere"><float name="radius" value="0.3"/>
    <point name="center" x="0.6" y="0.6" z="0.6"/><bsdf type="dielectric"/></shape>)");
}
TEST(Furnace, LessThanWhiteIsNoticed) {
  const stats::Moments m = furnace(cloud("0.99"));
  EXPECT_LT(m.mean(), 1 - 4 * m.standardError());
}

}  // namespace
}  // namespace virga
