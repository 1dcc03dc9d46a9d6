// SPDX-License-Identifier: Apache-2.0
// Media in all their variety, layer by layer against the brute-force tracer. Each world comes with wrong twins.
#include <gtest/gtest.h>

#include <cmath>

#include "methods/layers_checks.h"

namespace virga {
namespace {

using namespace virga::testing;
using brute::Grid;
using brute::Material;
using brute::Phase;
using brute::Region;
using brute::Vector;
using brute::World;

constexpr auto kBall = Region::Form::ball, kGlassBall = Region::Form::glassBall;

Region ballAt(Vector center, double radius, brute::Medium medium, Region::Form form = kBall) {
  const Vector half{radius, radius, radius};
  return {.form = form, .lo = center - half, .hi = center + half, .medium = std::move(medium)};
}

// --- extinction that differs between the channels ---

/// A plume whose red part leans to the left and whose blue part is even.
Grid colouredDensity() {
  Grid grid = plume();
  for (size_t i = 0; i < grid.values.size(); ++i) {
    const double x = (static_cast<double>(i % 16) + 0.5) / 16;
    grid.values[i] = grid.values[i] * Vector{2 * (1 - x), 1, 0} + Vector{0, 0, 0.1};
  }
  return grid;
}

/// Extinctions 20 times apart in a box, a lamp half within it; overlapping it, a cloud on a grid of colours.
World chromaticMedia() {
  World w;
  w.eye = {0.4, 0.6, 4};
  w.sky = {0.3, 0.3, 0.3};
  w.spheres = {{{-1.2, 1.2, 0.5}, 0.9, light(4, 4, 4)}};
  w.rectangles = {floorAt(-1, 1.6, matt(0.6, 0.6, 0.6))};
  w.regions = {
      {.lo = {-1.2, -1, -0.8},
       .hi = {0.3, 0.8, 0.8},
       .medium = {.sigmaT = 6,
                  .spectrum = {0.05, 0.25, 1},
                  .albedo = {0.95, 0.9, 0.8},
                  .lobe = {Phase::henyeyGreenstein, 0.3}}},
      {.lo = {-0.4, -0.9, -0.7},
       .hi = {1.1, 0.7, 0.7},
       .medium = {.sigmaT = 5, .spectrum = {1, 0.2, 0.4}, .albedo = {0.7, 0.9, 0.95}, .density = colouredDensity()}}};
  return w;
}

TEST(LayersOfMedia, ExtinctionOfColour) {
  expectAgreement(
      chromaticMedia(),
      {{Layer::emission, 0.001},
       {Layer::directSurface, 0.003},
       {Layer::directMedia, 0.005},
       {Layer::mediaToSurface, 0.01},
       {Layer::surfaceToMedia, 0.011},
       {Layer::mediaToMedia, 0.006}},
      {{"green of the box 7 % denser", {Layer::emission}, [](World& w) { w.regions[0].medium.spectrum.y *= 1.07; }},
       {"green of the box 15 % denser", {Layer::directMedia}, [](World& w) { w.regions[0].medium.spectrum.y *= 1.15; }},
       {"blue of the cloud 50 % denser",
        {Layer::mediaToMedia},
        [](World& w) { w.regions[1].medium.spectrum.z *= 1.5; }}},
      {.passes = 640, .samples = 2000});
}

// --- media that glow ---

/// Even glow in fog, flames on a grid, and a transparent ball that shines, before a mirror ball and a glass ball. There
/// is no other light.
World glowingMedia() {
  World w;
  w.eye = {0.2, 0.5, 4};
  w.rectangles = {floorAt(-1, 1.5, matt(0.7, 0.6, 0.5)), {{0, 0, -1.05}, {1.5, 0, 0}, {0, 1, 0}, matt(0.6, 0.6, 0.7)}};
  w.spheres = {{{0.8, -0.5, 0.6}, 0.4, {.kind = Material::Kind::glass}},
               {{-0.2, -0.6, 0.7}, 0.35, {.kind = Material::Kind::mirror, .specular = {0.9, 0.9, 0.8}}}};
  w.regions = {{.lo = {-1.3, -1.1, -1},
                .hi = {1.3, 1, 1.2},
                .medium = {.sigmaT = 0.7, .albedo = {0.9, 0.8, 0.7}, .emission = {0.1, 0.2, 0.4}}},
               {.lo = {-1.1, -1, -0.8},
                .hi = {0.1, 0.9, 0.4},
                .medium = {.sigmaT = 1,
                           .spectrum = {0.5, 1, 2},
                           .albedo = {0.6, 0.6, 0.6},
                           .emission = {8, 4, 1},
                           .emissionGrid = colouredDensity()}},
               ballAt({0.8, 0.4, -0.2}, 0.4, {.sigmaT = 0, .emission = {0.5, 1, 2}})};
  return w;
}

TEST(LayersOfMedia, Glow) {
  const auto dimmer = [](size_t region, double factor) {
    return [=](World& w) { w.regions[region].medium.emission = w.regions[region].medium.emission * factor; };
  };
  expectAgreement(glowingMedia(),
                  {{Layer::emission, 0.003},
                   {Layer::directSurface, 0.006},
                   {Layer::directMedia, 0.003},
                   {Layer::causticSurface, 0.013},
                   {Layer::causticMedia, 0.009},
                   {Layer::surfaceToSurface, 0.017},
                   {Layer::mediaToSurface, 0.007},
                   {Layer::surfaceToMedia, 0.008},
                   {Layer::mediaToMedia, 0.004}},
                  {{"fog 5 % dimmer", {Layer::emission}, dimmer(0, 0.95)},
                   {"flames 20 % dimmer", {Layer::directMedia}, dimmer(1, 0.8)},
                   {"ball 20 % dimmer", {Layer::emission}, dimmer(2, 0.8)}},
                  {.passes = 1300, .samples = 1700});
}

// --- phase functions ---

/// Four balls in the quarters of the picture: Rayleigh's function, a table with a peak aside, Schlick's, and a blend
/// that goes from forward scattering at the back to Rayleigh's in front.
World phaseFunctions() {
  World w;
  w.eye = {0, 0, 4};
  w.rectangles = {{{1.6, 0.8, 1.6}, {0.85, 0, -0.85}, {0.4, -1.1, 0.4}, light(3, 3, 3)}};
  const auto add = [&](double x, double y, const brute::Lobe& lobe) {
    w.regions.push_back(ballAt({x, y, 0}, 0.5, {.sigmaT = 3, .albedo = {0.95, 0.9, 0.8}, .lobe = lobe}));
  };
  add(-0.6, 0.6, {Phase::rayleigh});
  add(0.6, 0.6, {.phase = Phase::table, .table = {1, 0.2, 0.5, 0.1, 2, 0.4}});
  add(-0.6, -0.6, {Phase::schlick, 0.4});
  add(0.6, -0.6, {Phase::henyeyGreenstein, 0.7});
  w.regions[3].medium.other = {Phase::rayleigh};
  w.regions[3].medium.shareGrid = gridOf(4, [](double x, double, double z) {
    return Vector{1, 1, 1} * (0.4 * x + 0.6 * z);
  });
  return w;
}

TEST(LayersOfMedia, PhaseFunctions) {
  expectAgreement(
      phaseFunctions(), {{Layer::directMedia, 0.007}, {Layer::mediaToMedia, 0.01}},
      {{"isotropic for Rayleigh", {Layer::directMedia}, [](World& w) { w.regions[0].medium.lobe = {}; }},
       {"the table the other way round",
        {Layer::directMedia},
        [](World& w) { std::reverse(w.regions[1].medium.lobe.table.begin(), w.regions[1].medium.lobe.table.end()); }},
       {"k = 0.45", {Layer::directMedia}, [](World& w) { w.regions[2].medium.lobe.g = 0.45; }},
       {"an even share of its mean",
        {Layer::directMedia},
        [](World& w) {
          w.regions[3].medium.share = 0.5;
          w.regions[3].medium.shareGrid = {};
        }}},
      {.passes = 640, .samples = 3500});
}

// --- lamps in media ---

/// Lamps in thin fog, in a thick ball, in smoke on a grid, and in a ball of cloudy glass.
World lampsInMedia() {
  World w;
  w.eye = {0, 0.6, 4};
  w.rectangles = {floorAt(-1, 1.8, matt(0.6, 0.6, 0.5)),
                  {{0, 0, -1.1}, {1.8, 0, 0}, {0, 1, 0}, matt(0.5, 0.6, 0.6)},
                  {{-0.7, 0.5, 0}, {0.5, 0, 0.1}, {0, 0.35, 0}, light(3, 2.5, 2)}};
  w.spheres = {{{-0.45, -0.3, 0.45}, 0.25, light(4, 3.5, 3)},
               {{0.7, 0.5, -0.2}, 0.4, light(2, 2.5, 3)},
               {{0.8, -0.6, 0.65}, 0.3, light(3, 3, 2)}};
  w.regions = {{.lo = {-1.4, -1, -0.8},
                .hi = {0.4, 1, 1},
                .medium = {.sigmaT = 0.5, .albedo = {0.95, 0.9, 0.9}, .lobe = {Phase::henyeyGreenstein, 0.5}}},
               ballAt({0.7, 0.5, -0.2}, 0.6, {.sigmaT = 6, .albedo = {0.9, 0.95, 0.9}}),
               {.lo = {-1, -1, -0.1},
                .hi = {0.1, 0.4, 1},
                .medium = {.sigmaT = 8, .albedo = {0.9, 0.8, 0.7}, .density = plume()}},
               ballAt({0.8, -0.6, 0.6}, 0.38, {.sigmaT = 1.5, .albedo = {0.9, 0.9, 0.9}}, kGlassBall)};
  return w;
}

TEST(LayersOfMedia, LampsInside) {
  const auto denser = [](size_t region, double factor) {
    return [=](World& w) { w.regions[region].medium.sigmaT *= factor; };
  };
  expectAgreement(lampsInMedia(),
                  {{Layer::emission, 0.003},
                   {Layer::directSurface, 0.011},
                   {Layer::directMedia, 0.007},
                   {Layer::causticSurface, 0.008},
                   {Layer::causticMedia, 0.02},
                   {Layer::surfaceToSurface, 0.018},
                   {Layer::mediaToSurface, 0.011},
                   {Layer::surfaceToMedia, 0.013},
                   {Layer::mediaToMedia, 0.006}},
                  {{"fog 15 % denser", {Layer::mediaToMedia}, denser(0, 1.15)},
                   {"ball 20 % denser", {Layer::emission}, denser(1, 1.2)},
                   {"smoke three times as dense", {Layer::directMedia}, denser(2, 3)},
                   {"glass 40 % denser", {Layer::emission}, denser(3, 1.4)}},
                  {.passes = 1200, .samples = 2000});
}

// --- fluids in glass ---

/// In fog that lies on the ground: a ball of tinted glass with a fluid in it, both sides declared; a ball of glass
/// whose surface is the boundary of a fluid at once, and which touches the ground.
World fluidInGlass() {
  World w;
  w.eye = {0.1, 0.5, 4};
  w.sky = {0.7, 0.8, 1};
  w.spheres = {{{0.8, -0.5, 0.3}, 0.5, {.kind = Material::Kind::glass}}, {{-1.4, 1.6, 0.8}, 0.6, light(6, 5, 4)}};
  w.rectangles = {floorAt(-1, 1.8, matt(0.6, 0.5, 0.4)),
                  {{0, -0.4, -1.05}, {1.8, 0, 0}, {0, 0.6, 0}, matt(0.4, 0.5, 0.6)}};
  const Vector inner{-0.5, -0.2, 0};
  w.regions = {
      {.lo = {-1.5, -1, -1}, .hi = {1.5, 0.8, 1}, .medium = {.sigmaT = 0.3, .albedo = {0.9, 0.9, 0.9}}},
      ballAt(inner, 0.5, {.sigmaT = 3, .albedo = {0.95, 0.9, 0.7}, .lobe = {Phase::henyeyGreenstein, 0.6}}, kGlassBall),
      ballAt(inner, 0.7, {.sigmaT = 0.4, .albedo = {}}, kGlassBall),
      ballAt({0.8, -0.5, 0.3}, 0.5, {.sigmaT = 2, .albedo = {0.8, 0.9, 0.95}})};
  w.regions[1].within = 2;
  w.regions[1].wall.index = 1.33 / 1.5;
  w.regions[2].within = 0;
  return w;
}

TEST(LayersOfMedia, FluidInGlass) {
  expectAgreement(
      fluidInGlass(),
      {{Layer::emission, 0.002},
       {Layer::directSurface, 0.004},
       {Layer::directMedia, 0.004},
       {Layer::causticSurface, 0.019},
       {Layer::causticMedia, 0.011},
       {Layer::surfaceToSurface, 0.014},
       {Layer::mediaToSurface, 0.007},
       {Layer::surfaceToMedia, 0.008},
       {Layer::mediaToMedia, 0.005}},
      {{"inner fluid 40 % denser", {Layer::causticMedia}, [](World& w) { w.regions[1].medium.sigmaT *= 1.4; }},
       {"an inner surface to air", {Layer::emission}, [](World& w) { w.regions[1].wall.index = 1 / 1.5; }},
       {"clear glass", {Layer::mediaToMedia}, [](World& w) { w.regions[2].medium.sigmaT = 0; }},
       {"fluid on the ground 20 % denser", {Layer::causticMedia}, [](World& w) { w.regions[3].medium.sigmaT *= 1.2; }}},
      {.passes = 1200, .samples = 2000});
}

}  // namespace
}  // namespace virga
