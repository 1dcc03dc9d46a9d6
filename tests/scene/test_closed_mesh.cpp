// SPDX-License-Identifier: Apache-2.0
// Shapes that hold media: closed or open, and wound as they please.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "loaders/loading.h"
#include "scene/closed_mesh.h"
#include "scene/scenes.h"

namespace virga {
namespace {

using Triangles = std::vector<std::array<uint32_t, 3>>;

const Triangles kCubeTriangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                                  {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};

TriangleMesh cube(Vec3 at = Vec3(0)) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.positions.push_back(Bounds{at, at + Vec3(1)}.corner(i));
  mesh.triangles = kCubeTriangles;
  return mesh;
}

// Each triangle with vertices of its own, as STL-like files have them.
TriangleMesh torn(const TriangleMesh& mesh) {
  TriangleMesh result;
  for (const auto& t : mesh.triangles) {
    const auto first = static_cast<uint32_t>(result.positions.size());
    for (const uint32_t v : t) result.positions.push_back(mesh.positions[v]);
    result.triangles.push_back({first, first + 1, first + 2});
  }
  return result;
}

TriangleMesh both(TriangleMesh a, const TriangleMesh& b) {
  const auto offset = static_cast<uint32_t>(a.positions.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const auto& t : b.triangles) a.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  return a;
}

TriangleMesh turned(TriangleMesh mesh, std::initializer_list<size_t> which) {
  for (const size_t t : which) std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  return mesh;
}

TEST(OpenEdges, AClosedMeshHasNone) {
  EXPECT_EQ(openEdges(cube()), 0u);
  EXPECT_EQ(openEdges(torn(cube())), 0u) << "vertices at one place count as one";
  EXPECT_EQ(openEdges(both(cube(), cube({1, 1, 0}))), 0u) << "two cubes that touch along an edge";
  EXPECT_EQ(openEdges(both(cube(), cube({5, 0, 0}))), 0u);
  TriangleMesh sliver = cube();
  sliver.triangles.push_back({0, 0, 1});
  EXPECT_EQ(openEdges(sliver), 0u) << "a triangle that is a line closes and opens nothing";
}

TEST(OpenEdges, HolesAreCounted) {
  for (size_t t = 0; t < 12; ++t) {
    TriangleMesh mesh = torn(cube());
    mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(t));
    EXPECT_EQ(openEdges(mesh), 3u) << t;
  }
  TriangleMesh box = cube();
  box.triangles.resize(10);
  EXPECT_EQ(openEdges(box), 4u) << "a box without its lid";
  EXPECT_EQ(openEdges(turned(cube(), {5})), 3u) << "one triangle that disagrees";
}

TEST(Winding, TheMajorityDecides) {
  for (const auto which : {std::initializer_list<size_t>{0}, {3, 7}, {1, 2, 5, 8, 11}, {0, 1, 2, 3, 4}}) {
    TriangleMesh mesh = turned(torn(cube()), which);
    EXPECT_GT(openEdges(mesh), 0u);
    makeWindingAgree(mesh);
    EXPECT_EQ(mesh.triangles, torn(cube()).triangles);
  }
  TriangleMesh mostly = turned(cube(), {0, 1, 2, 3, 4, 5, 6, 7, 8});
  makeWindingAgree(mostly);
  EXPECT_EQ(openEdges(mostly), 0u);
  EXPECT_EQ(mostly.triangles, turned(cube(), {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}).triangles);
}

TEST(Winding, PartsAreTurnedByThemselves) {
  // A hollow: the inner cube is turned inside out on purpose.
  TriangleMesh inner = turned(cube(), {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
  for (Vec3& p : inner.positions) p = p * 0.5f + Vec3(0.25f);
  const TriangleMesh hollow = both(cube(), inner);
  TriangleMesh mesh = turned(hollow, {2, 15});
  makeWindingAgree(mesh);
  EXPECT_EQ(mesh.triangles, hollow.triangles);
}

// A band with half a twist has no outside: what is left is found by openEdges.
TEST(Winding, WhatHasNoOutsideDoesNoHarm) {
  TriangleMesh band;
  constexpr uint32_t kSteps = 12;
  for (uint32_t i = 0; i < kSteps; ++i) {
    const float a = kTwoPi * static_cast<float>(i) / kSteps, half = a / 2;
    for (const float side : {-0.3f, 0.3f})
      band.positions.push_back({(1 + side * std::cos(half)) * std::cos(a), (1 + side * std::cos(half)) * std::sin(a),
                                side * std::sin(half)});
  }
  for (uint32_t i = 0; i < kSteps; ++i) {
    const bool twist = i + 1 == kSteps;
    const uint32_t a = 2 * i, b = 2 * i + 1, c = twist ? 1 : 2 * i + 2, d = twist ? 0 : 2 * i + 3;
    band.triangles.push_back({a, b, c});
    band.triangles.push_back({b, d, c});
  }
  makeWindingAgree(band);
  EXPECT_GE(openEdges(band), 2 * kSteps + 1);
}

TEST(Winding, ManyTriangles) {
  TriangleMesh sheet;
  constexpr uint32_t kSide = 200;
  for (uint32_t y = 0; y <= kSide; ++y)
    for (uint32_t x = 0; x <= kSide; ++x)
      sheet.positions.push_back(Vec3(static_cast<float>(x), static_cast<float>(y), 0));
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x) {
      const uint32_t a = y * (kSide + 1) + x, b = a + 1, c = a + kSide + 1, d = c + 1;
      sheet.triangles.push_back({a, b, d});
      sheet.triangles.push_back({a, d, c});
    }
  const Triangles straight = sheet.triangles;
  for (size_t t = 0; t < sheet.triangles.size(); t += 3) std::swap(sheet.triangles[t][0], sheet.triangles[t][1]);
  makeWindingAgree(sheet);
  EXPECT_EQ(openEdges(sheet), 4 * kSide);
}

// --- warnings of the builder ---

std::string objOf(const TriangleMesh& mesh) {
  std::string text;
  for (const Vec3& p : mesh.positions) text += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  for (const auto& t : mesh.triangles) text += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return text;
}

constexpr const char* kFog = "<medium name=\"interior\" type=\"homogeneous\"/>";

class OpenShapes : public ::testing::Test {
 protected:
  std::vector<std::string> warnings(const std::string& shape) const {
    return test::build("<emitter type=\"constant\"/>" + shape, folder_.path().string())->warnings;
  }
  std::string obj(const TriangleMesh& mesh, const std::string& inside) const {
    folder_.write("mesh.obj", objOf(mesh));
    return "\n<shape type=\"obj\" id=\"cloud\"><string name=\"filename\" value=\"mesh.obj\"/>" + inside + "</shape>";
  }
  static std::string fogIn(const std::string& type) {
    return "<shape type=\"" + type + "\"><bsdf type=\"null\"/>" + kFog + "</shape>";
  }
  const loading::TemporaryFolder folder_;
};

TEST_F(OpenShapes, AreWarnedOfOnceWithTheirPlace) {
  TriangleMesh lidless = cube();
  lidless.triangles.resize(10);
  const auto found = warnings(obj(lidless, std::string("<bsdf type=\"null\"/>") + kFog));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].starts_with(
      "test.xml:3:14: warning: the obj \"cloud\" holds a medium and is open: 4 of its "
      "edges have no neighbour that agrees, and light that passes beside it takes the wrong medium along"))
      << found[0];
  EXPECT_NE(found[0].find("close it"), std::string::npos) << found[0];
}

TEST_F(OpenShapes, AreAlsoSheetsAndGlass) {
  ASSERT_EQ(warnings(fogIn("rectangle")).size(), 1u);
  EXPECT_NE(warnings(fogIn("rectangle"))[0].find("the rectangle holds a medium and is open: 4 of"), std::string::npos);
  EXPECT_EQ(warnings(fogIn("disk")).size(), 1u);
  TriangleMesh lidless = cube();
  lidless.triangles.resize(10);
  EXPECT_EQ(warnings(obj(lidless, std::string("<bsdf type=\"dielectric\"/>") + kFog)).size(), 1u);
}

TEST_F(OpenShapes, NeedAMediumInside) {
  for (const char* closed : {"cube", "sphere"}) EXPECT_TRUE(warnings(fogIn(closed)).empty()) << closed;
  EXPECT_TRUE(warnings("<shape type=\"rectangle\"/>").empty());
  EXPECT_TRUE(warnings("<shape type=\"rectangle\"><bsdf type=\"null\"/></shape>").empty());
  EXPECT_TRUE(warnings("<shape type=\"rectangle\"><medium name=\"exterior\" type=\"homogeneous\"/></shape>").empty())
      << "a floor that stands in fog";
  EXPECT_TRUE(warnings("<shape type=\"rectangle\"><bsdf type=\"dielectric\"/><medium name=\"exterior\" "
                       "type=\"homogeneous\"/><medium name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" "
                       "value=\"2\"/></medium></shape>")
                  .empty())
      << "the surface of a lake";
}

TEST_F(OpenShapes, AreNotThoseThatAreWoundBadly) {
  for (const auto& mesh : {turned(cube(), {0, 5}), torn(turned(cube(), {0, 1, 2, 3, 4, 5, 6, 7, 9}))})
    EXPECT_TRUE(warnings(obj(mesh, std::string("<bsdf type=\"null\"/>") + kFog)).empty());
}

TEST_F(OpenShapes, AreStillKnownAfterAnEdit) {
  const std::string text = fogIn("rectangle") + "<emitter type=\"constant\"/>" + test::kSensor;
  const SceneSnapshot before = buildScene(test::describe(text));
  EXPECT_EQ(buildScene(test::describe(text), {}, before)->warnings, before->warnings);
  EXPECT_EQ(before->warnings.size(), 1u);
}

}  // namespace
}  // namespace virga
