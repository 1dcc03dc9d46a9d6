// SPDX-License-Identifier: Apache-2.0
// Surfaces of all materials in fog, layer by layer against the brute-force tracer. Each world comes with wrong twins.
#include <gtest/gtest.h>

#include "methods/layers_checks.h"

namespace virga {
namespace {

using namespace virga::testing;
using brute::Material;
using brute::Phase;
using brute::Vector;
using brute::World;
using Facets = Material::Facets;

brute::Region fogBox(Vector lo, Vector hi, double sigmaT, double g) {
  return {.lo = lo,
          .hi = hi,
          .medium = {.sigmaT = sigmaT, .albedo = {0.9, 0.9, 0.9}, .lobe = {Phase::henyeyGreenstein, g}}};
}

// --- rough metal ---

constexpr Vector kGoldEta{0.143, 0.375, 1.442}, kGoldK{3.983, 2.386, 1.603};
constexpr Vector kIronEta{2.9, 2.9, 2.6}, kIronK{3.1, 2.9, 2.8};

/// A golden ball (GGX) on an iron floor (Beckmann), and a screen that is rough on both sides, seen from behind.
World roughMetalInFog() {
  World w;
  w.eye = {0, 0.7, 4};
  w.sky = {0.1, 0.1, 0.1};
  const Material gold{
      .kind = Material::Kind::roughMetal, .specular = {1, 1, 1}, .alpha = 0.3, .eta = kGoldEta, .k = kGoldK};
  const Material iron{.kind = Material::Kind::roughMetal,
                      .specular = {0.9, 0.9, 0.9},
                      .facets = Facets::beckmann,
                      .alpha = 0.45,
                      .eta = kIronEta,
                      .k = kIronK};
  Material screen = gold;
  screen.alpha = 0.6;
  screen.twoSided = true;
  w.spheres = {{{-0.9, 1, 0.3}, 0.6, light(5, 5, 4)}, {{0.5, -0.25, 0.7}, 0.75, gold}};
  w.rectangles = {floorAt(-1, 2, iron), {{0, 0, -1}, {-2, 0, 0}, {0, 1, 0}, screen}};
  w.regions = {fogBox({-1.8, -1, -1.5}, {1.8, 1.4, 1.5}, 0.4, 0.4)};
  return w;
}

TEST(LayersOfMaterials, RoughMetal) {
  expectAgreement(
      roughMetalInFog(),
      {{Layer::emission, 0.003},
       {Layer::directSurface, 0.008},
       {Layer::directMedia, 0.008},
       {Layer::surfaceToSurface, 0.015},
       {Layer::mediaToSurface, 0.014},
       {Layer::surfaceToMedia, 0.013},
       {Layer::mediaToMedia, 0.011}},
      {{"ball a third smoother", {Layer::surfaceToSurface}, [](World& w) { w.spheres[1].material.alpha = 0.2; }},
       {"floor 10 % smoother", {Layer::directSurface}, [](World& w) { w.rectangles[0].material.alpha = 0.4; }},
       {"floor with the other facets",
        {Layer::directSurface},
        [](World& w) { w.rectangles[0].material.facets = Facets::ggx; }},
       {"gold without its colour", {Layer::surfaceToSurface}, [](World& w) {
          w.spheres[1].material.eta = {0.143, 0.143, 0.143};
        }}});
}

// --- rough glass ---

/// Balls of rough glass with fog in and around them (GGX, Beckmann), and one that encloses a fluid.
World roughGlassInFog() {
  World w;
  w.eye = {0, 0.5, 4};
  w.sky = {0.4, 0.5, 0.6};
  w.rectangles = {floorAt(-1, 1.8, matt(0.6, 0.5, 0.4))};
  w.spheres = {{{-0.9, 1.3, 0.3}, 0.5, light(6, 5, 4)},
               {{-0.7, -0.4, 0.3}, 0.5, {.kind = Material::Kind::roughGlass, .alpha = 0.25}},
               {{0.7, -0.5, 0.4},
                0.5,
                {.kind = Material::Kind::roughGlass, .index = 1.33, .facets = Facets::beckmann, .alpha = 0.5}}};
  w.regions = {fogBox({-1.5, -1, -1}, {1.5, 1.2, 1.2}, 0.4, 0.3),
               {.form = brute::Region::Form::glassBall,
                .lo = {-0.1, 0.1, -0.6},
                .hi = {0.9, 1.1, 0.4},
                .medium = {.sigmaT = 2, .albedo = {0.95, 0.9, 0.8}},
                .within = 0,
                .wall = {.kind = Material::Kind::roughGlass, .alpha = 0.15}}};
  return w;
}

TEST(LayersOfMaterials, RoughGlass) {
  expectAgreement(
      roughGlassInFog(),
      {{Layer::emission, 0.003},
       {Layer::directSurface, 0.006},
       {Layer::directMedia, 0.005},
       {Layer::surfaceToSurface, 0.007},
       {Layer::mediaToSurface, 0.008},
       {Layer::surfaceToMedia, 0.009},
       {Layer::mediaToMedia, 0.008}},
      {{"ball 20 % smoother", {Layer::surfaceToSurface}, [](World& w) { w.spheres[1].material.alpha = 0.2; }},
       {"index 1.45", {Layer::directSurface}, [](World& w) { w.spheres[2].material.index = 1.45; }},
       {"the other facets", {Layer::surfaceToSurface}, [](World& w) { w.spheres[2].material.facets = Facets::ggx; }},
       {"rougher wall", {Layer::mediaToSurface}, [](World& w) { w.regions[1].wall.alpha = 0.3; }}},
      {.passes = 640, .samples = 2500});
}

// --- panes ---

/// A pane under a lamp, and one between the eye and half of the fog that both stand in.
World panesInFog() {
  World w;
  w.eye = {0, 0.4, 4};
  w.sky = {0.05, 0.05, 0.1};
  const Material pane{.kind = Material::Kind::pane};
  Material heavy = pane;
  heavy.index = 2;
  w.rectangles = {floorAt(-1, 1.6, matt(0.7, 0.6, 0.5)),
                  ceilingAt(1.3, 0.8, light(4, 4, 5)),
                  {{0, 0, -1.25}, {1.6, 0, 0}, {0, 1, 0}, matt(0.5, 0.6, 0.7)},
                  {{-0.2, 0.7, 0}, {0.8, 0.3, 0}, {0, 0, 0.9}, heavy},
                  {{0.7, -0.1, 1}, {0.6, 0, 0.3}, {0, 0.8, 0}, pane}};
  w.regions = {fogBox({-1.5, -1.1, -1.3}, {1.5, 1.2, 1.4}, 0.5, 0.3)};
  return w;
}

TEST(LayersOfMaterials, Panes) {
  expectAgreement(
      panesInFog(),
      {{Layer::emission, 0.006},
       {Layer::directSurface, 0.011},
       {Layer::directMedia, 0.006},
       {Layer::causticSurface, 0.011},
       {Layer::causticMedia, 0.009},
       {Layer::surfaceToSurface, 0.02},
       {Layer::mediaToSurface, 0.009},
       {Layer::surfaceToMedia, 0.009},
       {Layer::mediaToMedia, 0.006}},
      {{"index 1.6 under the lamp",
        {Layer::causticSurface, Layer::causticMedia},
        [](World& w) { w.rectangles[3].material.index = 1.6; }},
       {"index 1.7 before the eye", {Layer::emission}, [](World& w) { w.rectangles[4].material.index = 1.7; }}},
      {.passes = 640, .samples = 3500});
}

// If a pane that light goes straight through ended a segment, nothing would be left behind it.
TEST(LayersOfMaterials, PanesEndNoSegment) {
  World world = panesInFog();
  world.maxDepth = 2;
  expectAgreement(world,
                  {{Layer::emission, 0.007},
                   {Layer::directSurface, 0.015},
                   {Layer::directMedia, 0.007},
                   {Layer::causticSurface, 0.013},
                   {Layer::causticMedia, 0.01}},
                  {{"a segment less", {Layer::causticSurface, Layer::causticMedia}, [](World& w) { w.maxDepth = 1; }},
                   {"a segment more", {Layer::mediaToMedia}, [](World& w) { w.maxDepth = 3; }}},
                  {.passes = 320, .samples = 2000});
}

// --- boards ---

/// A floor and a wall whose squares are not square, so that neither may be turned.
World boardsInFog() {
  World w;
  w.eye = {0.2, 0.5, 4};
  const Material floor{.diffuse = {0.8, 0.2, 0.1}, .board = {1.25, 0.75, {0.1, 0.3, 0.8}}};
  const Material wall{.diffuse = {0.1, 0.6, 0.1}, .board = {0.75, 0.6, {0.9, 0.9, 0.9}}, .twoSided = true};
  w.rectangles = {
      floorAt(-1, 1.5, floor), ceilingAt(1.3, 1, light(4, 4, 4)), {{0, 0, -1}, {-1.4, 0, 0}, {0, 1, 0}, wall}};
  w.regions = {fogBox({-1.5, -1, -1.3}, {1.5, 1.2, 1.4}, 0.3, 0)};
  return w;
}

TEST(LayersOfMaterials, Boards) {
  expectAgreement(
      boardsInFog(),
      {{Layer::emission, 0.004},
       {Layer::directSurface, 0.004},
       {Layer::directMedia, 0.003},
       {Layer::surfaceToSurface, 0.013},
       {Layer::mediaToSurface, 0.007},
       {Layer::surfaceToMedia, 0.009},
       {Layer::mediaToMedia, 0.007}},
      {{"the floor's u and v swapped",
        {Layer::surfaceToMedia},
        [](World& w) { std::swap(w.rectangles[0].material.board.u, w.rectangles[0].material.board.v); }},
       {"the wall's colours swapped",
        {Layer::surfaceToSurface},
        [](World& w) { std::swap(w.rectangles[2].material.diffuse, w.rectangles[2].material.board.other); }}},
      {.passes = 640, .samples = 5000});
}

}  // namespace
}  // namespace virga
