// SPDX-License-Identifier: Apache-2.0
// Surfaces of all kinds in fog: `ims` against `path`, layer by layer.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "image/scratch.h"
#include "methods/ims_checks.h"

namespace virga {
namespace {

using namespace virga::testing;
using brute::Material;
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
Region fogBox(Vector lo, Vector hi, double sigmaT, double g) {
  return {.lo = lo,
          .hi = hi,
          .medium = {.sigmaT = sigmaT, .albedo = {0.9, 0.9, 0.9}, .lobe = {Phase::henyeyGreenstein, g}}};
}

constexpr Vector kIronEta{2.9, 2.9, 2.6}, kIronK{3.1, 2.9, 2.8};

/// Balls and a floor that virtual lights light (Phong's exponent 12, alpha 0.4), and ones that they do not (30, 0.2).
World glossyInFog() {
  World w = world({0, 0.7, 4});
  w.spheres = {
      {{-0.9, 0.9, 0.3}, 0.6, light(5, 5, 4)},
      {{0.7, -0.5, 0.5},
       0.5,
       {.kind = Material::Kind::phong, .diffuse = {0.3, 0.1, 0.1}, .specular = {0.6, 0.6, 0.5}, .exponent = 12}},
      {{-0.5, -0.5, 0.6},
       0.5,
       {.kind = Material::Kind::roughMetal, .specular = {1, 1, 1}, .alpha = 0.4, .eta = kIronEta, .k = kIronK}}};
  w.rectangles = {
      floorAt(-1, 2,
              {.kind = Material::Kind::phong, .diffuse = {0.2, 0.3, 0.2}, .specular = {0.5, 0.5, 0.5}, .exponent = 30}),
      {{0, 0, -0.8},
       {-2, 0, 0},
       {0, 1, 0},
       {.kind = Material::Kind::roughMetal,
        .specular = {0.9, 0.9, 0.9},
        .alpha = 0.2,
        .eta = kIronEta,
        .k = kIronK,
        .twoSided = true}}};
  w.regions = {fogBox({-1.8, -1, -1.5}, {1.8, 1.4, 1.5}, 0.4, -0.4)};
  return w;
}

TEST(ImsMaterials, Glossy) {
  expectImsIsPath(elementsOf(glossyInFog()), {{Layer::emission, 0.01},
                                              {Layer::directSurface, 0.015},
                                              {Layer::directMedia, 0.015},
                                              {Layer::surfaceToSurface, 0.035},
                                              {Layer::mediaToSurface, 0.02},
                                              {Layer::surfaceToMedia, 0.035},
                                              {Layer::mediaToMedia, 0.02}});
}

/// A glass ball, a mirror ball and a two-sided mirror in fog.
World glassAndMirrorInFog() {
  World w = world({0, 0.5, 4.2});
  w.rectangles = {floorAt(-1, 1.6, matt(0.7, 0.6, 0.5)),
                  ceilingAt(1.3, 1.1, light(4, 4, 5)),
                  {{-1.3, 0, -0.2},
                   {0, 0, 0.8},
                   {0, 0.9, 0},
                   {.kind = Material::Kind::mirror, .specular = {0.9, 0.8, 0.7}, .twoSided = true}}};
  w.spheres = {{{0.6, -0.3, 0.4}, 0.6, {.kind = Material::Kind::glass}},
               {{-0.4, -0.4, -0.4}, 0.5, {.kind = Material::Kind::mirror, .specular = {0.9, 0.9, 0.9}}}};
  w.regions = {fogBox({-1.5, -1.1, -1.5}, {1.5, 1.2, 1.5}, 0.5, 0)};
  return w;
}

TEST(ImsMaterials, GlassAndMirror) {
  expectImsIsPath(elementsOf(glassAndMirrorInFog()), {{Layer::emission, 0.02},
                                                      {Layer::directSurface, 0.015},
                                                      {Layer::directMedia, 0.005},
                                                      {Layer::causticSurface, 0.05},
                                                      {Layer::causticMedia, 0.05},
                                                      {Layer::mediaToSurface, 0.03},
                                                      {Layer::surfaceToMedia, 0.03},
                                                      {Layer::mediaToMedia, 0.01}});
}

/// Fog in a ball of rough glass and around another one.
World roughGlassInFog() {
  World w = world({0, 0.3, 3.6});
  w.sky = {0.4, 0.5, 0.6};
  w.rectangles = {floorAt(-1, 1.8, matt(0.6, 0.5, 0.4))};
  w.spheres = {{{-0.9, 1.3, 0.3}, 0.6, light(5, 4, 3)},
               {{-0.5, -0.5, 0.3}, 0.5, {.kind = Material::Kind::roughGlass, .alpha = 0.5}}};
  w.regions = {fogBox({-1.5, -1, -1}, {1.5, 1.2, 1.2}, 0.4, 0.3),
               {.form = Region::Form::glassBall,
                .lo = {-0.1, -0.3, -0.6},
                .hi = {0.9, 0.7, 0.4},
                .medium = {.sigmaT = 2, .albedo = {0.95, 0.9, 0.8}},
                .within = 0,
                .wall = {.kind = Material::Kind::roughGlass, .alpha = 0.45}}};
  return w;
}

TEST(ImsMaterials, RoughGlass) {
  expectImsIsPath(elementsOf(roughGlassInFog()),
                  {{Layer::emission, 0.01},
                   {Layer::directSurface, 0.01},
                   {Layer::directMedia, 0.01},
                   {Layer::surfaceToSurface, 0.045},
                   {Layer::mediaToSurface, 0.03},
                   {Layer::surfaceToMedia, 0.02},
                   {Layer::mediaToMedia, 0.015}},
                  {.sets = 4, .passes = 6}, {.others = {{"walks", "4096"}, {"lights", "16"}}});
}

/// A pane under a lamp, and one between the eye and half of the fog that both stand in.
World panesInFog() {
  World w = world({0, 0.4, 4});
  w.sky = {0.05, 0.05, 0.1};
  const Material pane{.kind = Material::Kind::pane};
  Material heavy = pane;
  heavy.index = 2;
  w.rectangles = {floorAt(-1, 1.6, matt(0.7, 0.6, 0.5)),
                  ceilingAt(1.3, 0.8, light(4, 4, 5)),
                  {{-0.2, 0.7, 0}, {0.8, 0.3, 0}, {0, 0, 0.9}, heavy},
                  {{0.7, -0.1, 1}, {0.6, 0, 0.3}, {0, 0.8, 0}, pane}};
  w.regions = {fogBox({-1.5, -1.1, -1.3}, {1.5, 1.2, 1.4}, 0.5, 0.3)};
  return w;
}

TEST(ImsMaterials, Panes) {
  for (const int depth : {3, 8}) {
    World w = panesInFog();
    w.maxDepth = depth;
    expectImsIsPath(elementsOf(w),
                    {{Layer::emission, 0.035},
                     {Layer::directSurface, 0.03},
                     {Layer::directMedia, 0.015},
                     {Layer::causticSurface, 0.025},
                     {Layer::causticMedia, 0.02},
                     {Layer::mediaToSurface, 0.045},
                     {Layer::surfaceToMedia, 0.03},
                     {Layer::mediaToMedia, 0.025}},
                    {.sets = 8});
  }
}

// A coarse mesh whose shading normals are far from its own: light walks meet the shading normal where eye paths do
// not.
TEST(ImsMaterials, ShadingNormals) {
  const std::filesystem::path path = scratchFile("octahedron.obj");
  {
    std::ofstream file(path);
    const int corners[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (const auto& c : corners)
      file << fmt::format("v {0} {1} {2}\nvn {0} {1} {2}\n", 0.8 * c[0], 0.8 * c[1], 0.8 * c[2]);
    for (int i = 0; i < 8; ++i) {
      const int x = i & 1 ? 2 : 1, y = i & 2 ? 4 : 3, z = i & 4 ? 6 : 5;
      const bool even = ((i & 1) + (i >> 1 & 1) + (i >> 2 & 1)) % 2 == 0;
      file << fmt::format("f {0}//{0} {1}//{1} {2}//{2}\n", x, even ? y : z, even ? z : y);
    }
  }
  World w = world({0.4, 0.8, 3.6});
  w.sky = {0.1, 0.1, 0.2};
  w.spheres = {{{-1.1, 1.5, 0.9}, 0.5, light(8, 7, 6)}};
  w.rectangles = {floorAt(-1, 1.6, matt(0.8, 0.8, 0.8)), {{0, 0, -1.1}, {1.6, 0, 0}, {0, 1, 0}, matt(0.7, 0.7, 0.7)}};
  w.regions = {fogBox({-1.5, -1.1, -1.3}, {1.5, 1.2, 1.4}, 0.3, 0)};
  for (const char* bsdf : {R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.9, 0.8, 0.7"/></bsdf>)",
                           R"(<bsdf type="roughconductor"><float name="alpha" value="0.5"/></bsdf>)"}) {
    const std::string mesh =
        fmt::format(R"(<shape type="obj"><string name="filename" value="{}"/>{}</shape>)", path.string(), bsdf);
    expectImsIsPath(elementsOf(w) + mesh,
                    {{Layer::directSurface, 0.01},
                     {Layer::surfaceToSurface, 0.04},
                     {Layer::mediaToSurface, 0.025},
                     {Layer::surfaceToMedia, 0.025}},
                    {.sets = 8});
  }
}

}  // namespace
}  // namespace virga
