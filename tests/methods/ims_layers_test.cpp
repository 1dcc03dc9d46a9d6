// SPDX-License-Identifier: Apache-2.0
// `ims` against `path`, layer by layer, over a hundredfold range of bounds and with both compensations.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "image/image_io.h"
#include "image/scratch.h"
#include "methods/ims_checks.h"

namespace virga {
namespace {

using namespace virga::testing;
using brute::Phase;
using brute::Region;
using brute::Vector;
using brute::World;

World world(Vector eye, double fieldOfView = 35) {
  World w;
  w.eye = eye;
  w.fieldOfView = fieldOfView;
  w.size = 20;
  w.maxDepth = 8;
  return w;
}
Region boxOf(Vector lo, Vector hi, brute::Medium medium) {
  return {.form = Region::Form::box, .lo = lo, .hi = hi, .medium = std::move(medium)};
}
Region ballAt(Vector center, double radius, brute::Medium medium, Region::Form form = Region::Form::ball) {
  const Vector half{radius, radius, radius};
  return {.form = form, .lo = center - half, .hi = center + half, .medium = std::move(medium)};
}

/// A plume in the corner of a room, a lamp on the ceiling.
World smokeInRoom() {
  World w = world({0.5, 0.2, 3.6});
  w.rectangles = {floorAt(-1, 2, matt(0.6, 0.5, 0.4)),
                  ceilingAt(1.2, 1, light(4, 3.5, 3)),
                  {{0, 0, -1.2}, {2, 0, 0}, {0, 2, 0}, matt(0.3, 0.5, 0.7)}};
  w.regions = {boxOf({-0.8, -1, -0.9}, {0.9, 1.1, 0.8}, {.sigmaT = 9, .albedo = {0.95, 0.9, 0.8}, .density = plume()})};
  return w;
}

TEST(ImsLayers, SmokeInRoom) {
  expectImsIsPath(elementsOf(smokeInRoom()), {{Layer::emission, 0.015},
                                              {Layer::directSurface, 0.005},
                                              {Layer::directMedia, 0.01},
                                              {Layer::surfaceToSurface, 0.015},
                                              {Layer::mediaToSurface, 0.02},
                                              {Layer::surfaceToMedia, 0.025},
                                              {Layer::mediaToMedia, 0.015}});
}

/// A closed room full of fog, seen from within; its boundary lies on the walls, and the lamp on the boundary.
World fogInRoom() {
  World w = world({0.2, 0.1, 0.9}, 80);
  w.target = {0, 0, -1};
  w.rectangles = {floorAt(-1, 1, matt(0.7, 0.7, 0.7)),
                  ceilingAt(1, 0.6, light(3, 3, 2)),
                  {{0, 0, -1}, {1, 0, 0}, {0, 1, 0}, matt(0.5, 0.5, 0.6)},
                  {{0, 0, 1}, {-1, 0, 0}, {0, 1, 0}, matt(0.5, 0.5, 0.5)},
                  {{-1, 0, 0}, {0, 0, -1}, {0, 1, 0}, matt(0.6, 0.1, 0.1)},
                  {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}, matt(0.1, 0.6, 0.1)}};
  w.regions = {boxOf({-1, -1, -1}, {1, 1, 1}, {.sigmaT = 0.85, .albedo = {0.94, 0.94, 0.9}})};
  return w;
}

TEST(ImsLayers, FogInRoom) {
  expectImsIsPath(elementsOf(fogInRoom()), {{Layer::emission, 0.025},
                                            {Layer::directSurface, 0.015},
                                            {Layer::directMedia, 0.005},
                                            {Layer::surfaceToSurface, 0.035},
                                            {Layer::mediaToSurface, 0.025},
                                            {Layer::surfaceToMedia, 0.01},
                                            {Layer::mediaToMedia, 0.01}});
}

/// A strongly forward-scattering ball between a lamp and the eye.
World forwardBall() {
  World w = world({0, 0.4, 4.5});
  w.sky = {0.2, 0.3, 0.5};
  w.spheres = {{{0.8, 1.2, -2.5}, 0.9, light(6, 5, 4)}};
  w.rectangles = {floorAt(-1.05, 3, matt(0.5, 0.5, 0.5))};
  w.regions = {
      ballAt({0, 0, 0}, 1, {.sigmaT = 2.5, .albedo = {0.99, 0.95, 0.9}, .lobe = {Phase::henyeyGreenstein, 0.85}})};
  return w;
}

TEST(ImsLayers, StronglyForward) {
  expectImsIsPath(elementsOf(forwardBall()),
                  {{Layer::emission, 0.005},
                   {Layer::directSurface, 0.005},
                   {Layer::directMedia, 0.025},
                   {Layer::surfaceToMedia, 0.035},
                   {Layer::mediaToSurface, 0.035},
                   {Layer::mediaToMedia, 0.035}},
                  {.sets = 4, .passes = 4}, {.others = {{"walks", "4096"}, {"lights", "16"}}});
}

/// Two overlapping fogs of different colour, extinctions up to ten times apart between the channels.
World chromaticFog() {
  World w = world({0.3, 0.4, 4});
  w.sky = {0.3, 0.3, 0.3};
  w.spheres = {{{-1.2, 1.3, 0.8}, 0.8, light(4, 4, 4)}};
  w.rectangles = {floorAt(-1, 1.6, matt(0.6, 0.6, 0.6))};
  w.regions = {
      boxOf(
          {-1.2, -1, -0.8}, {0.3, 0.8, 0.8},
          {.sigmaT = 3, .spectrum = {0.1, 0.4, 1}, .albedo = {0.95, 0.9, 0.8}, .lobe = {Phase::henyeyGreenstein, 0.3}}),
      boxOf({-0.4, -0.9, -0.7}, {1.1, 0.7, 0.7},
            {.sigmaT = 4, .spectrum = {1, 0.2, 0.4}, .albedo = {0.7, 0.9, 0.95}, .density = plume()})};
  return w;
}

TEST(ImsLayers, ExtinctionOfColour) {
  expectImsIsPath(elementsOf(chromaticFog()), {{Layer::emission, 0.005},
                                               {Layer::directSurface, 0.01},
                                               {Layer::directMedia, 0.01},
                                               {Layer::mediaToSurface, 0.03},
                                               {Layer::surfaceToMedia, 0.03},
                                               {Layer::mediaToMedia, 0.015}});
}

/// Media that overlap, one cut out of another, a ball of cloudy glass in a third.
World overlappingMedia() {
  World w = world({0.3, 0.4, 3.6});
  w.sky = {0.5, 0.6, 0.8};
  w.spheres = {{{-1.6, 1.4, 0.4}, 0.7, light(4, 3, 2)}};
  w.rectangles = {floorAt(-1, 2, matt(0.5, 0.5, 0.5))};
  w.regions = {boxOf({-1.2, -1, -0.8}, {0.2, 0.6, 0.8}, {.sigmaT = 0.8, .albedo = {0.9, 0.5, 0.5}}),
               boxOf({-0.3, -0.9, -0.7}, {1.3, 0.3, 0.7},
                     {.sigmaT = 1.2, .albedo = {0.5, 0.9, 0.5}, .lobe = {Phase::henyeyGreenstein, 0.5}}),
               ballAt({0.1, 0.4, 0}, 0.6, {.sigmaT = 3, .albedo = {0.6, 0.6, 0.95}, .density = plume()}),
               boxOf({-1.1, -0.9, -0.3}, {-0.6, -0.2, 0.5}, {.sigmaT = 3, .albedo = {0.9, 0.9, 0.2}}),
               ballAt({0.9, -0.4, 0}, 0.3, {.sigmaT = 2, .albedo = {0.9, 0.9, 0.9}}, Region::Form::glassBall)};
  w.regions[3].within = 0;
  w.regions[4].within = 1;
  return w;
}

TEST(ImsLayers, OverlappingMedia) {
  expectImsIsPath(elementsOf(overlappingMedia()), {{Layer::emission, 0.005},
                                                   {Layer::directSurface, 0.02},
                                                   {Layer::directMedia, 0.01},
                                                   {Layer::causticMedia, 0.055},
                                                   {Layer::mediaToSurface, 0.03},
                                                   {Layer::surfaceToMedia, 0.02},
                                                   {Layer::mediaToMedia, 0.015}});
}

/// A lamp and a ball that glows, in fog that glows a little.
TEST(ImsLayers, MediaThatGlow) {
  World w = fogInRoom();
  w.regions[0].medium.emission = {0.02, 0.05, 0.1};
  w.regions.push_back(
      ballAt({0.3, -0.4, -0.3}, 0.3, {.sigmaT = 2, .albedo = {0.5, 0.5, 0.5}, .emission = {3, 1, 0.3}}));
  expectImsIsPath(elementsOf(w),
                  {{Layer::emission, 0.025},
                   {Layer::directSurface, 0.015},
                   {Layer::directMedia, 0.005},
                   {Layer::surfaceToSurface, 0.035},
                   {Layer::mediaToSurface, 0.025},
                   {Layer::surfaceToMedia, 0.012},
                   {Layer::mediaToMedia, 0.01}},
                  {.sets = 14}, {.radii = {0.25, 1}});
}

// --- a picture around the scene ---

/// A sky with a low sun and a dim ground.
std::string skyFile() {
  Image sky(32, 16);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x) {
      const bool sun = x >= 20 && x < 23 && y >= 3 && y < 6;
      const Rgb above(0.3f, 0.5f, 1), below(0.1f, 0.08f, 0.05f);
      sky.pixels[static_cast<size_t>(y * 32 + x)] = sun ? Rgb(30, 25, 15) : y < 8 ? above : below;
    }
  const std::filesystem::path path = scratchFile("sky.exr");
  writeExr(path, sky);
  return path.string();
}

// The room of the smoke without its lamp, open to the sky, which is seen beside it.
TEST(ImsLayers, SmokeUnderASky) {
  World w = smokeInRoom();
  w.fieldOfView = 60;
  w.rectangles.erase(w.rectangles.begin() + 1);
  const std::string sky = fmt::format(R"(<emitter type="envmap"><string name="filename" value="{}"/>
    <transform name="to_world"><rotate y="1" angle="40"/></transform></emitter>)",
                                      skyFile());
  expectImsIsPath(elementsOf(w) + sky,
                  {{Layer::emission, 0.01},
                   {Layer::directSurface, 0.01},
                   {Layer::directMedia, 0.02},
                   {Layer::surfaceToSurface, 0.02},
                   {Layer::mediaToSurface, 0.03},
                   {Layer::surfaceToMedia, 0.035},
                   {Layer::mediaToMedia, 0.03}},
                  {}, {.radii = {0.25, 1}});
}

// --- the longest path ---

// Without the right count of segments a depth would be missing or be there twice.
TEST(ImsLayers, LimitedDepth) {
  for (const int depth : {2, 3, 4, 6}) {
    World w = fogInRoom();
    w.maxDepth = depth;
    std::vector<Power> powers = {{Layer::directSurface, 0.02}, {Layer::directMedia, 0.01}};
    if (depth > 2)
      powers.insert(powers.end(), {{Layer::surfaceToSurface, 0.075},
                                   {Layer::mediaToSurface, 0.045},
                                   {Layer::surfaceToMedia, 0.02},
                                   {Layer::mediaToMedia, 0.015}});
    expectImsIsPath(elementsOf(w), powers, {.sets = 8}, {.radii = {0.3, 1}});
  }
}

/// A ball of fog over a floor under lamps that have no size.
TEST(ImsLayers, APointASpotAndTheSun) {
  World w = world({0, 0.4, 4.5});
  w.rectangles = {floorAt(-1.05, 3, matt(0.6, 0.5, 0.4))};
  w.regions = {ballAt({0, 0, 0}, 1, {.sigmaT = 2, .albedo = {0.95, 0.9, 0.8}})};
  const std::string lamps = R"(
    <emitter type="point"><point name="position" x="-1.5" y="2" z="1"/><rgb name="intensity" value="8, 7, 6"/></emitter>
    <emitter type="spot"><transform name="to_world"><lookat origin="2, 1.5, 1" target="0, 0, 0" up="0, 1, 0"/></transform>
      <float name="cutoff_angle" value="25"/><rgb name="intensity" value="5, 10, 15"/></emitter>
    <emitter type="directional"><vector name="direction" x="0.3" y="-1" z="-0.2"/><rgb name="irradiance" value="1, 1, 2"/></emitter>)";
  expectImsIsPath(elementsOf(w) + lamps,
                  {{Layer::directSurface, 0.01},
                   {Layer::directMedia, 0.012},
                   {Layer::mediaToSurface, 0.015},
                   {Layer::surfaceToMedia, 0.015},
                   {Layer::mediaToMedia, 0.01}},
                  {.sets = 64}, {.radii = {0.25, 1}});
}

TEST(ImsLayers, ADepthTooManyIsNoticed) {
  World w = fogInRoom();
  w.maxDepth = 4;
  const SceneSnapshot scene = sceneOf(elementsOf(w));
  const Estimates truth = estimates(scene, "path", {}, {.sets = 16});
  for (const char* depth : {"3", "5"}) {
    const Estimates wrong =
        estimates(scene, "ims", {{"walks", "512"}, {"radius", "0.3"}, {"max_depth", depth}}, {.sets = 8});
    EXPECT_LT(differenceOf(wrong, truth, static_cast<size_t>(Layer::mediaToMedia)).p, kDisagree) << depth;
  }
}

}  // namespace
}  // namespace virga
