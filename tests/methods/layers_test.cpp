// SPDX-License-Identifier: Apache-2.0
// Worlds whose layers are held against the brute-force tracer, and lights that it cannot meet against small ones.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "methods/layers_checks.h"
#include "transport/tabled_lamps.h"

namespace virga {
namespace {

using namespace virga::testing;
using brute::Grid;
using brute::Material;
using brute::Phase;
using brute::Region;
using brute::Vector;
using brute::World;

// --- worlds ---

/// A plume of smoke in the corner of a room, a lamp on the ceiling.
World smokeInRoom() {
  World w;
  w.eye = {0.5, 0.3, 4.5};
  w.rectangles = {floorAt(-1, 2, matt(0.6, 0.5, 0.4)),
                  ceilingAt(1.2, 1, light(4, 3.5, 3)),
                  {{0, 0, -1.3}, {2, 0, 0}, {0, 2, 0}, matt(0.3, 0.5, 0.7)}};
  w.regions = {{.lo = {-0.8, -1, -0.9},
                .hi = {0.9, 1.1, 0.8},
                .medium = {.sigmaT = 9, .albedo = {0.95, 0.9, 0.8}, .density = plume()}}};
  return w;
}

/// A closed room full of fog, whose boundary lies on the walls, seen from within.
World fogInRoom() {
  World w;
  w.eye = {0.2, 0.1, 0.9};
  w.target = {0, 0, -1};
  w.fieldOfView = 80;
  w.rectangles = {floorAt(-1, 1, matt(0.7, 0.7, 0.7)),
                  ceilingAt(1, 1, matt(0.7, 0.7, 0.7)),
                  ceilingAt(0.99, 0.6, light(3, 3, 2)),
                  {{0, 0, -1}, {1, 0, 0}, {0, 1, 0}, matt(0.5, 0.5, 0.6)},
                  {{0, 0, 1}, {-1, 0, 0}, {0, 1, 0}, matt(0.5, 0.5, 0.5)},
                  {{-1, 0, 0}, {0, 0, -1}, {0, 1, 0}, matt(0.6, 0.1, 0.1)},
                  {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}, matt(0.1, 0.6, 0.1)}};
  w.regions = {{.lo = {-1, -1, -1}, .hi = {1, 1, 1}, .medium = {.sigmaT = 0.85, .albedo = {0.94, 0.94, 0.9}}}};
  return w;
}

/// A strongly forward-scattering ball between a lamp and the eye.
World forwardBall() {
  World w;
  w.sky = {0.2, 0.3, 0.5};
  w.spheres = {{{0.8, 1.2, -2.5}, 0.9, light(6, 5, 4)}};
  w.rectangles = {floorAt(-1.05, 3, matt(0.5, 0.5, 0.5))};
  w.regions = {{.form = Region::Form::ball,
                .lo = {-1, -1, -1},
                .hi = {1, 1, 1},
                .medium = {.sigmaT = 3, .albedo = {0.99, 0.95, 0.9}, .lobe = {Phase::henyeyGreenstein, 0.85}}}};
  return w;
}

/// Glossy ground and a glossy screen seen from behind, in thin fog that scatters backward.
World glossyInFog() {
  World w;
  w.eye = {0, 0.7, 4};
  w.spheres = {
      {{-0.9, 1, 0.2}, 0.9, light(2.5, 2.5, 2)},
      {{0.5, -0.4, 0.3},
       0.6,
       {.kind = Material::Kind::phong, .diffuse = {0.3, 0.1, 0.1}, .specular = {0.6, 0.6, 0.5}, .exponent = 12}}};
  w.rectangles = {
      floorAt(-1, 2,
              {.kind = Material::Kind::phong, .diffuse = {0.2, 0.3, 0.2}, .specular = {0.5, 0.5, 0.5}, .exponent = 30}),
      {{0, 0, -1},
       {-2, 0, 0},
       {0, 1, 0},
       {.kind = Material::Kind::phong,
        .diffuse = {0.2, 0.2, 0.5},
        .specular = {0.4, 0.3, 0.2},
        .exponent = 8,
        .twoSided = true}}};
  w.regions = {{.lo = {-1.8, -1, -1.5},
                .hi = {1.8, 1.4, 1.5},
                .medium = {.sigmaT = 0.4, .albedo = {0.9, 0.9, 0.9}, .lobe = {Phase::henyeyGreenstein, -0.4}}}};
  return w;
}

/// A glass ball, a mirror ball and a two-sided mirror in fog.
World glassAndMirrorInFog() {
  World w;
  w.eye = {0, 0.6, 4.5};
  w.rectangles = {floorAt(-1, 1.6, matt(0.7, 0.6, 0.5)),
                  ceilingAt(1.3, 1.5, light(2, 2, 2.5)),
                  {{0, 0, -1.4}, {1.5, 0, 0}, {0, 1, 0}, matt(0.5, 0.6, 0.7)},
                  {{-1.3, 0, -0.2},
                   {0, 0, 0.8},
                   {0, 0.9, 0},
                   {.kind = Material::Kind::mirror, .specular = {0.9, 0.8, 0.7}, .twoSided = true}}};
  w.spheres = {{{0.6, -0.3, 0.4}, 0.6, {.kind = Material::Kind::glass}},
               {{-0.4, -0.4, -0.4}, 0.5, {.kind = Material::Kind::mirror, .specular = {0.9, 0.9, 0.9}}}};
  w.regions = {{.lo = {-1.5, -1.1, -1.5}, .hi = {1.5, 1.2, 1.5}, .medium = {.sigmaT = 0.5, .albedo = {0.9, 0.9, 0.9}}}};
  return w;
}

/// Boxes and a ball that overlap, a denser box cut out of one of them, a ball of cloudy glass in another.
World overlappingMedia() {
  World w;
  w.eye = {0.4, 0.5, 4};
  w.sky = {0.5, 0.6, 0.8};
  w.spheres = {{{-2.1, 1.7, 0.5}, 1, light(2, 1.5, 1)}};
  w.rectangles = {floorAt(-1, 2, matt(0.6, 0.6, 0.6)), {{0, -0.3, -1}, {1.8, 0, 0}, {0, 0.7, 0}, matt(0.6, 0.6, 0.6)}};
  w.regions = {{.lo = {-1.2, -1, -0.8}, .hi = {0.2, 0.6, 0.8}, .medium = {.sigmaT = 0.8, .albedo = {0.9, 0.5, 0.5}}},
               {.lo = {-0.3, -0.9, -0.7},
                .hi = {1.3, 0.3, 0.7},
                .medium = {.sigmaT = 1.2, .albedo = {0.5, 0.9, 0.5}, .lobe = {Phase::henyeyGreenstein, 0.5}}},
               {.form = Region::Form::ball,
                .lo = {-0.5, -0.2, -0.6},
                .hi = {0.7, 1, 0.6},
                .medium = {.sigmaT = 3, .albedo = {0.6, 0.6, 0.95}, .density = plume()}},
               {.lo = {-1.1, -0.9, -0.3},
                .hi = {-0.6, -0.2, 0.5},
                .medium = {.sigmaT = 5, .albedo = {0.9, 0.9, 0.2}},
                .within = 0},
               {.form = Region::Form::glassBall,
                .lo = {0.44, -0.85, -0.3},
                .hi = {1.26, -0.03, 0.52},
                .medium = {.sigmaT = 0.7, .albedo = {0.9, 0.9, 0.9}},
                .within = 1}};
  return w;
}

/// A cloud of Cornette and Shanks' phase function whose density and albedo vary.
World colouredCloud() {
  World w;
  w.eye = {0.3, 0.2, 4};
  w.sky = {0.1, 0.1, 0.15};
  w.spheres = {{{1.7, 1.5, 1}, 0.9, light(3, 3, 3)}};
  w.rectangles = {{{0, -0.4, -0.5}, {1.2, 0, 0.4}, {0, 0.8, 0}, {.diffuse = {0.7, 0.6, 0.5}, .twoSided = true}}};
  const Grid albedo = gridOf(5, [](double x, double y, double z) {
    return Vector{0.3 + 0.7 * x, 0.2 + 0.8 * y, 1 - 0.9 * z};
  });
  w.regions = {
      {.lo = {-1, -1.1, -1.2},
       .hi = {1.1, 1, 1},
       .medium = {.sigmaT = 6, .lobe = {Phase::cornetteShanks, 0.6}, .density = plume(), .albedoGrid = albedo}}};
  return w;
}

// --- tests ---

TEST(Layers, SmokeInRoom) {
  expectAgreement(smokeInRoom(),
                  {{Layer::emission, 0.002},
                   {Layer::directSurface, 0.004},
                   {Layer::directMedia, 0.009},
                   {Layer::surfaceToSurface, 0.007},
                   {Layer::mediaToSurface, 0.012},
                   {Layer::surfaceToMedia, 0.02},
                   {Layer::mediaToMedia, 0.009}},
                  {}, {.passes = 800, .samples = 2500});
}
TEST(Layers, FogInRoomAndWhatIsWrongInIt) {
  const World world = fogInRoom();
  const Effort effort{.passes = 700, .samples = 1700};
  const Picture truth = brute::render(world, thorough(effort.samples), 1);
  const Picture right = pictureByPath(elementsOf(world), 1, thorough(effort.passes));
  expectAgreement(right, truth,
                  {{Layer::emission, 0.015},
                   {Layer::directSurface, 0.017},
                   {Layer::directMedia, 0.006},
                   {Layer::surfaceToSurface, 0.017},
                   {Layer::mediaToSurface, 0.011},
                   {Layer::surfaceToMedia, 0.006},
                   {Layer::mediaToMedia, 0.005}});
  World darker = world;
  darker.regions[0].medium.albedo = world.regions[0].medium.albedo * 0.97;
  const Picture wrong = pictureByPath(elementsOf(darker), 2, effort.passes / 2);
  EXPECT_LT(compared(wrong, truth, Layer::directMedia).p, kSuspicious) << "albedo";
  EXPECT_LT(compared(wrong, truth, Layer::mediaToMedia).p, kSuspicious) << "albedo";
  EXPECT_GT(compared(wrong, truth, Layer::directSurface).p, kSuspicious) << "the albedo has no part in it";
  EXPECT_LT(compared(right, Layer::mediaToSurface, truth, Layer::surfaceToMedia).p, kSuspicious) << "layers swapped";
}
TEST(Layers, StronglyForward) {
  expectAgreement(forwardBall(),
                  {{Layer::emission, 0.001},
                   {Layer::directSurface, 0.003},
                   {Layer::directMedia, 0.011},
                   {Layer::mediaToSurface, 0.013},
                   {Layer::surfaceToMedia, 0.02},
                   {Layer::mediaToMedia, 0.006}},
                  {}, {.passes = 1000, .samples = 3000});
}
TEST(Layers, GlossyInFog) {
  expectAgreement(glossyInFog(),
                  {{Layer::emission, 0.002},
                   {Layer::directSurface, 0.007},
                   {Layer::directMedia, 0.005},
                   {Layer::surfaceToSurface, 0.02},
                   {Layer::mediaToSurface, 0.012},
                   {Layer::surfaceToMedia, 0.019},
                   {Layer::mediaToMedia, 0.008}},
                  {}, {.passes = 640, .samples = 5000});
}
TEST(Layers, GlassAndMirrorInFog) {
  expectAgreement(glassAndMirrorInFog(),
                  {{Layer::emission, 0.002},
                   {Layer::directSurface, 0.007},
                   {Layer::directMedia, 0.003},
                   {Layer::causticSurface, 0.02},
                   {Layer::causticMedia, 0.02},
                   {Layer::surfaceToSurface, 0.02},
                   {Layer::mediaToSurface, 0.007},
                   {Layer::surfaceToMedia, 0.009},
                   {Layer::mediaToMedia, 0.005}},
                  {}, {.passes = 900, .samples = 3000});
}
TEST(Layers, OverlappingMedia) {
  expectAgreement(overlappingMedia(),
                  {{Layer::emission, 0.001},
                   {Layer::directSurface, 0.003},
                   {Layer::directMedia, 0.004},
                   {Layer::causticSurface, 0.02},
                   {Layer::causticMedia, 0.017},
                   {Layer::surfaceToSurface, 0.01},
                   {Layer::mediaToSurface, 0.005},
                   {Layer::surfaceToMedia, 0.006},
                   {Layer::mediaToMedia, 0.004}},
                  {}, {.passes = 1400, .samples = 2000});
}
TEST(Layers, ColouredCloud) {
  expectAgreement(colouredCloud(),
                  {{Layer::emission, 0.001},
                   {Layer::directSurface, 0.005},
                   {Layer::directMedia, 0.01},
                   {Layer::mediaToSurface, 0.014},
                   {Layer::surfaceToMedia, 0.017},
                   {Layer::mediaToMedia, 0.011}},
                  {}, {.passes = 640, .samples = 2500});
}

// --- lights that nothing meets by chance, as small lights that something does ---

std::string pointAt(const std::string& place) {
  return R"(<emitter type="point"><point name="position" )" + place + R"(<rgb name="intensity" value="5"/></emitter>)";
}
std::string smallSphereAt(const std::string& place) {
  const double radius = 0.0001;  // light that starts at its surface has so much less fog before it
  return fmt::format(R"(<shape type="sphere"><point name="center" {}<float name="radius" value="{}"/>
    <emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>)",
                     place, radius, 5 / (M_PI * radius * radius));
}

// Outside of the picture: near a light in fog pixels vary without bound.
TEST(Layers, PointLightIsASmallSphere) {
  World world = glossyInFog();
  world.spheres.erase(world.spheres.begin());
  const std::string elements = elementsOf(world), place = R"(x="-0.3" y="1.3" z="1.4"/>)";
  const int passes = thorough(1100);
  expectAgreement(pictureByPath(elements + pointAt(place), 2, passes),
                  pictureByPath(elements + smallSphereAt(place), 1, passes),
                  {{Layer::directSurface, 0.004},
                   {Layer::directMedia, 0.003},
                   {Layer::surfaceToSurface, 0.014},
                   {Layer::mediaToSurface, 0.012},
                   {Layer::surfaceToMedia, 0.02},
                   {Layer::mediaToMedia, 0.008}},
                  Compare::notEmission);
}

// The point's light is looked up in a table of optical depths and gathered along flights, the sphere's is sampled.
TEST(Layers, PointLightIsASmallSphereInSmoke) {
  World world = smokeInRoom();
  world.rectangles.erase(world.rectangles.begin() + 1);
  const std::string elements = elementsOf(world), place = R"(x="-1.1" y="1.4" z="1"/>)";
  const SceneSnapshot scene = sceneOf(elements + pointAt(place));
  const TabledLamps lamps(*scene, tabledLampSide(*scene, world.size * world.size), {});
  ASSERT_TRUE(lamps.view().size > 0 && lamps.view()[0].present());
  const Picture truth = pictureByPath(elements + smallSphereAt(place));
  expectAgreement(pictureByPath(elements + pointAt(place), 2), truth,
                  {{Layer::directSurface, 0.001},
                   {Layer::directMedia, 0.007},
                   {Layer::surfaceToSurface, 0.004},
                   {Layer::mediaToSurface, 0.01},
                   {Layer::surfaceToMedia, 0.016},
                   {Layer::mediaToMedia, 0.01}},
                  Compare::notEmission);
  world.regions[0].medium.sigmaT *= 1.15;
  const Picture denser = pictureByPath(elementsOf(world) + pointAt(place), 3);
  for (const Layer layer : {Layer::directSurface, Layer::mediaToMedia})
    EXPECT_LT(compared(denser, truth, layer).p, kSuspicious) << "the test cannot fail";
}

TEST(Layers, DirectionalLightIsAFarSphere) {
  World world = smokeInRoom();
  world.rectangles.erase(world.rectangles.begin() + 1);
  const std::string elements = elementsOf(world);
  const Vector toLight{0.36, 0.48, 0.8};
  const double far = 2000, radius = 20;
  const Picture sphere =
      pictureByPath(elements + fmt::format(R"(<shape type="sphere"><point name="center" x="{}" y="{}" z="{}"/>
    <float name="radius" value="{}"/><emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>)",
                                           toLight.x * far, toLight.y * far, toLight.z * far, radius,
                                           2 / (M_PI * std::pow(radius / far, 2))));
  const Picture directional = pictureByPath(
      elements + fmt::format(R"(<emitter type="directional"><vector name="direction" x="{}" y="{}" z="{}"/>
    <rgb name="irradiance" value="2"/></emitter>)",
                             -toLight.x, -toLight.y, -toLight.z),
      2);
  expectAgreement(directional, sphere,
                  {{Layer::directSurface, 0.001},
                   {Layer::directMedia, 0.006},
                   {Layer::surfaceToSurface, 0.003},
                   {Layer::mediaToSurface, 0.009},
                   {Layer::surfaceToMedia, 0.016},
                   {Layer::mediaToMedia, 0.01}},
                  Compare::notEmission);
}

// A small disk shines with the cosine of the angle, and nested spots, each of which falls off between two angles, add
// up to the cosine's interpolation, which lies below it by 1/12 of the squared step on average. Light that fog scatters
// back to the disk ends there, but passes the spots: in the midst of the fog a radius of 0.05 takes 2 % more from
// media_to_media than one of 0.005 does. Outside of the picture, like the point above.
TEST(Layers, SpotsAreASmallDisk) {
  World world = glossyInFog();
  world.spheres.erase(world.spheres.begin());
  const std::string
      elements = elementsOf(world),
      pose =
          R"(<transform name="to_world"><lookat origin="-0.9, 1.3, 1.4" target="0.5, -0.4, 0" up="0, 1, 0"/></transform>)";
  const double radius = 0.005, step = M_PI / 24;
  const std::string scaled =
      fmt::format(R"(<transform name="to_world"><scale value="{}"/>)", radius) + pose.substr(pose.find("<lookat"));
  const Picture disk = pictureByPath(elements + "<shape type=\"disk\">" + scaled +
                                     fmt::format(R"(<emitter type="area"><rgb name="radiance" value="{}"/>
    </emitter></shape>)",
                                                 5 / (M_PI * radius * radius)));
  std::string spots;
  for (int i = 0; i < 12; ++i)
    spots += "<emitter type=\"spot\">" + pose +
             fmt::format(R"(<rgb name="intensity" value="{}"/><float name="beam_width" value="{}"/>
      <float name="cutoff_angle" value="{}"/></emitter>)",
                         5 * (1 + step * step / 12) * (std::cos(i * step) - std::cos((i + 1) * step)), i * 7.5,
                         (i + 1) * 7.5);
  expectAgreement(pictureByPath(elements + spots, 2), disk,
                  {{Layer::directSurface, 0.006},
                   {Layer::directMedia, 0.01},
                   {Layer::surfaceToSurface, 0.016},
                   {Layer::mediaToSurface, 0.011},
                   {Layer::surfaceToMedia, 0.02},
                   {Layer::mediaToMedia, 0.01}},
                  Compare::notEmission);
}

}  // namespace
}  // namespace virga
