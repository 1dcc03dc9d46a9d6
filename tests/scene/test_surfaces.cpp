// SPDX-License-Identifier: Apache-2.0
// Shapes as surfaces: texture coordinates and tangents (numbers from Mitsuba 3.9), the cylinder, and the parameters of
// thin and rough bsdfs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "core/random.h"
#include "loaders/loading.h"
#include "scene/scene_parts.h"
#include "scene/scenes.h"
#include "stats/stats.h"

namespace virga {
namespace {

struct Met {
  Vec2 uv;
  Vec3 normal, tangent;
};

/// What the ray meets on a scene of one shape.
std::optional<Met> meet(const std::string& shape, Vec3 origin, Vec3 d, const std::string& folder = ".") {
  const SceneSnapshot scene = test::build(shape + "<emitter type=\"constant\"/>", folder);
  const Ray ray{origin, normalize(d)};
  const RayHit hit = scene->surfaceRays->nearest(ray, 0, kInfinity);
  if (!hit.found()) return std::nullopt;
  const ShapeView& view = scene->view.surfaces[0];
  const SurfacePoint p = surfacePoint(view, ray, hit, scene->view.scale);
  return Met{surfaceUv(view, p.p, hit.primitive, {hit.u, hit.v}), p.geometricNormal,
             normalize(surfaceTangent(view, p.p, hit.primitive))};
}

void expectMeets(const std::string& shape, Vec3 origin, Vec3 d, Vec2 uv, Vec3 normal, Vec3 tangent,
                 const std::string& folder = ".") {
  const auto met = meet(shape, origin, d, folder);
  ASSERT_TRUE(met) << shape;
  EXPECT_NEAR(met->uv.x, uv.x, 1e-4f) << shape;
  EXPECT_NEAR(met->uv.y, uv.y, 1e-4f) << shape;
  EXPECT_LT(distance(met->normal, normal), 2e-3f) << shape;
  EXPECT_LT(distance(met->tangent, normalize(tangent)), 2e-3f) << shape;
}

std::string shape(const char* type, const std::string& inside = "") {
  return fmt::format("<shape type=\"{}\">{}</shape>", type, inside);
}
std::string placed(const std::string& steps) { return "<transform name=\"to_world\">" + steps + "</transform>"; }

const Vec3 kDown(0, 0, -1), kAbove(0.5f, -0.2f, 2);

TEST(TextureCoordinates, AreThoseOfMitsubaOnRoundShapes) {
  expectMeets(shape("sphere"), kAbove, kDown, {0.93944f, 0.181f}, {0.5f, -0.2f, 0.843f}, {0.371f, 0.928f, 0});
  expectMeets(shape("sphere", "<float name=\"radius\" value=\"2\"/><point name=\"center\" x=\"1\" y=\"0\" z=\"0\"/>"),
              {0.5f, -0.2f, 9}, kDown, {0.56056f, 0.0868f}, {-0.25f, -0.1f, 0.963f}, {0.371f, -0.928f, 0});
  expectMeets(shape("sphere", placed("<rotate x=\"1\" angle=\"90\"/>")), kAbove, kDown, {0.1648f, 0.4359f},
              {0.5f, -0.2f, 0.843f}, {-5.294f, 0, 3.142f});
  expectMeets(shape("disk"), kAbove, kDown, {0.53852f, 0.93944f}, {0, 0, 1}, {0.928f, -0.371f, 0});
  expectMeets(shape("disk"), {-0.5f, 0.2f, 2}, kDown, {0.53852f, 0.43944f}, {0, 0, 1}, {-0.928f, 0.371f, 0});
  expectMeets(shape("cylinder"), {3, 0.5f, 0.3f}, {-1, 0, 0}, {0.08333f, 0.3f}, {0.866f, 0.5f, 0}, {-0.5f, 0.866f, 0});
  expectMeets(shape("cylinder"), {-3, 0.5f, 0.3f}, {1, 0, 0}, {0.41667f, 0.3f}, {-0.866f, 0.5f, 0},
              {-0.5f, -0.866f, 0});
  expectMeets(shape("cylinder",
                    "<point name=\"p0\" x=\"1\" y=\"0\" z=\"0\"/><point name=\"p1\" x=\"0\" y=\"0\" "
                    "z=\"2\"/><float name=\"radius\" value=\"0.5\"/>"),
              {-3, 0.1f, 0.7f}, {1, 0, 0}, {0.468f, 0.4595f}, {-0.876f, 0.2f, -0.438f}, {-0.562f, -3.078f, -0.281f});
}

TEST(TextureCoordinates, AreThoseOfMitsubaOnFlatShapes) {
  expectMeets(shape("rectangle"), kAbove, kDown, {0.75f, 0.4f}, {0, 0, 1}, {1, 0, 0});
  struct Face {
    Vec3 normal;
    Vec2 uv;
    Vec3 tangent;
  };
  const Vec3 inner(0.3f, 0.5f, -0.2f);
  for (const Face& f : {Face{{1, 0, 0}, {0.75f, 0.6f}, {0, 1, 0}},
                        {{-1, 0, 0}, {0.75f, 0.4f}, {0, 1, 0}},
                        {{0, 1, 0}, {0.35f, 0.6f}, {-1, 0, 0}},
                        {{0, -1, 0}, {0.4f, 0.65f}, {0, 0, 1}},
                        {{0, 0, 1}, {0.75f, 0.65f}, {0, 1, 0}},
                        {{0, 0, -1}, {0.25f, 0.65f}, {0, -1, 0}}}) {
    const Vec3 origin = inner * (Vec3(1.f) - abs(f.normal)) + f.normal * 3;
    expectMeets(shape("cube"), origin, -f.normal, f.uv, f.normal, f.tangent);
  }
}

TEST(TextureCoordinates, OfMeshesAreTheFilesTurnedOverForObj) {
  const loading::TemporaryFolder folder;
  folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.1 0.2\nvt 0.9 0.2\nvt 0.1 0.8\nf 1/1 2/2 3/3\n");
  folder.write("bare.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string body =
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0.1 0.2\n1 0 0 0.9 0.2\n0 1 0 0.1 "
      "0.8\n3 0 1 2\n";
  folder.write("uv.ply", header + "property float u\nproperty float v\n" + body);
  folder.write("st.ply", header + "property float s\nproperty float t\n" + body);
  const auto expectUv = [&](const char* type, const char* file, const char* more, Vec2 uv) {
    expectMeets(shape(type, fmt::format("<string name=\"filename\" value=\"{}\"/>{}", file, more)), {0.25f, 0.25f, 2},
                kDown, uv, {0, 0, 1}, {1, 0, 0}, folder.path().string());
  };
  const char* const flip = "<boolean name=\"flip_tex_coords\" value=\"true\"/>";
  const char* const keep = "<boolean name=\"flip_tex_coords\" value=\"false\"/>";
  expectUv("obj", "t.obj", "", {0.3f, 0.65f});
  expectUv("obj", "t.obj", keep, {0.3f, 0.35f});
  expectUv("obj", "bare.obj", "", {0.25f, 0.25f});
  for (const char* file : {"uv.ply", "st.ply"}) {
    expectUv("ply", file, "", {0.3f, 0.35f});
    expectUv("ply", file, flip, {0.3f, 0.65f});
  }
}

// --- Cylinder

TEST(Cylinder, IsAnOpenTube) {
  EXPECT_FALSE(meet(shape("cylinder"), {0.2f, 0.5f, 3}, kDown)) << "along the axis, inside";
  EXPECT_FALSE(meet(shape("cylinder"), {0.2f, 3, 3}, kDown)) << "along the axis, outside";
  const auto inside = meet(shape("cylinder"), {0, 0, 0.3f}, {1, 0.5f, 0});
  ASSERT_TRUE(inside);
  EXPECT_LT(distance(inside->normal, {0.894f, 0.447f, 0}), 2e-3f) << "normals point outside";
  const auto flipped =
      meet(shape("cylinder", "<boolean name=\"flip_normals\" value=\"true\"/>"), {3, 0.5f, 0.3f}, {-1, 0, 0});
  EXPECT_LT(distance(flipped->normal, {-0.866f, -0.5f, 0}), 2e-3f);
  EXPECT_FALSE(meet(shape("cylinder"), {3, 0.5f, 1.001f}, {-1, 0, 0}));
  EXPECT_FALSE(meet(shape("cylinder"), {3, 0.5f, -0.001f}, {-1, 0, 0}));
  EXPECT_FALSE(meet(shape("cylinder"), {3, 1.001f, 0.5f}, {-1, 0, 0}));
  EXPECT_TRUE(meet(shape("cylinder"), {3, 0.999f, 0.5f}, {-1, 0, 0}));
}

// In through an end, out through the side; all against the quadratic equation in the tube's own frame.
TEST(Cylinder, CrossingsAreWhereTheEquationHasThem) {
  const auto rays = RayShape::cylinder({1, 2, 3}, normalize(Vec3(1, 2, -2)), 0.5f, 3);
  const RayScene scene({rays});
  const Frame frame(normalize(Vec3(1, 2, -2)));
  Pcg32 rng(3);
  int twice = 0, once = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3 o(6 * rng.next() - 2, 6 * rng.next() - 1, 6 * rng.next() - 1),
        d = uniformSphere({rng.next(), rng.next()});
    CrossingList list;
    scene.crossings({o, d}, 0, kInfinity, list);
    const Vec3 lo = frame.toLocal(o - Vec3(1, 2, 3)), ld = frame.toLocal(d);
    const double a = static_cast<double>(ld.x) * ld.x + static_cast<double>(ld.y) * ld.y;
    const double b = static_cast<double>(lo.x) * ld.x + static_cast<double>(lo.y) * ld.y;
    const double c = static_cast<double>(lo.x) * lo.x + static_cast<double>(lo.y) * lo.y - 0.25;
    int expected = 0;
    if (b * b > a * c)
      for (const double side : {-1.0, 1.0}) {
        const double t = (-b + side * std::sqrt(b * b - a * c)) / a, z = lo.z + t * static_cast<double>(ld.z);
        if (t < 0 || z < 0 || z > 3) continue;
        ASSERT_LT(expected, list.count);
        EXPECT_NEAR(static_cast<double>(list.items[expected].t), t, 1e-4 * (1 + t));
        EXPECT_EQ(list.items[expected].entering, side < 0);
        ++expected;
      }
    EXPECT_EQ(list.count, expected);
    EXPECT_EQ(scene.nearest({o, d}, 0, kInfinity).found(), expected > 0);
    EXPECT_EQ(scene.occluded({o, d}, 0, kInfinity), expected > 0);
    (expected == 2 ? twice : once) += expected > 0;
  }
  EXPECT_GT(twice, 50);
  EXPECT_GT(once, 50);
}

TEST(Cylinder, IsFoundFromFarAway) {
  const RayScene scene({RayShape::cylinder({0, 0, 0}, {0, 0, 1}, 1e-3f, 1)});
  const RayHit hit = scene.nearest({{5e3f, 0.5e-3f, 0.5f}, {-1, 0, 0}}, 0, kInfinity);
  ASSERT_TRUE(hit.found());
  EXPECT_FALSE(scene.nearest({{5e3f, 1.1e-3f, 0.5f}, {-1, 0, 0}}, 0, kInfinity).found());
}

/// A lamp around an axis from the origin on; 1: to (0.5, 1, 1).
std::string tube(double length) {
  return fmt::format(R"(<shape type="cylinder"><float name="radius" value="0.4"/>
    <point name="p1" x="{}" y="{}" z="{}"/><emitter type="area"/></shape>)",
                     0.5 * length, length, length);
}
/// Tests of the lamp's samples have to reject those of this one.
constexpr double kTooLong = 1.05;

TEST(Cylinder, ShinesUniformlyByArea) {
  const SceneSnapshot scene = test::build(tube(1)), longer = test::build(tube(kTooLong));
  const ShapeView& shape = scene->view.surfaces[0];
  EXPECT_NEAR(scene->view.emitters[0].area, kTwoPi * 0.4f * 1.5f, 1e-5f);
  const auto p = [&](const Scene& own) {
    const EmitterView& emitter = own.view.emitters[0];
    Pcg32 rng(7);
    std::vector<double> counts(64, 0.0);
    for (int i = 0; i < 100'000; ++i) {
      const LightPoint on = uniformPointOnShape(own.view.surfaces[0], emitter, {rng.next(), rng.next()});
      EXPECT_EQ(on.areaPdf, 1 / emitter.area);
      const Vec2 uv = surfaceUv(shape, on.p, 0, {});
      const int i8 = std::min(7, static_cast<int>(uv.x * 8)), j8 = std::min(7, static_cast<int>(uv.y * 8));
      ++counts[static_cast<size_t>(8 * j8 + i8)];
      EXPECT_NEAR(dot(on.normal, shape.normal), 0, 1e-5f);
    }
    return stats::chiSquaredCounts(counts, std::vector<double>(64, 1e5 / 64));
  };
  EXPECT_GT(p(*scene), 1e-4);
  EXPECT_LT(p(*longer), 1e-4) << "the test cannot fail";
}

/// What the lamp's lit side is seen as from x: a hit, or nothing. Not through an end, onto the inside.
std::optional<SurfacePoint> litPoint(const Scene& scene, Vec3 x, Vec3 w) {
  const RayHit hit = scene.surfaceRays->nearest({x, w}, 0, kInfinity);
  if (!hit.found()) return std::nullopt;
  const SurfacePoint p = surfacePoint(scene.view.surfaces[0], {x, w}, hit, scene.view.scale);
  return dot(p.geometricNormal, w) < 0 ? std::optional(p) : std::nullopt;
}

/// The solid angle of the lit side, and the integral of 1 + cos(angle to the lamp's axis) over it.
struct LitIntegrals {
  stats::Moments integrals[2];
  void add(double whole, Vec3 w) {
    integrals[0].add(whole);
    integrals[1].add(whole * static_cast<double>(1 + w.z));
  }
};

LitIntegrals fromLightSamples(const Scene& scene, Vec3 x) {
  const EmitterView& emitter = scene.view.emitters[0];
  LitIntegrals found;
  Pcg32 rng(11);
  for (int i = 0; i < 200'000; ++i) {
    const LightSample s = sampleLight(scene.view, emitter, x, {rng.next(), rng.next()});
    const bool seen = s.pdf > 0 && !scene.surfaceRays->occluded({x, s.wi}, 0, s.distance * 0.999f);
    found.add(seen ? 1 / static_cast<double>(s.pdf) : 0, s.wi);
    const auto on = seen ? litPoint(scene, x, s.wi) : std::nullopt;
    if (!on || std::fabs(dot(on->geometricNormal, s.wi)) < 0.02f) continue;
    EXPECT_NEAR(s.pdf, areaLightPdf(scene.view.surfaces[0], emitter, x, on->p, on->geometricNormal), 1e-2f * s.pdf);
  }
  return found;
}

LitIntegrals fromDirections(const Scene& scene, Vec3 x) {
  const Frame toTube(normalize(Vec3(0.25f, 0.5f, 0.5f) - x));
  constexpr float kHeight = 0.5f;
  LitIntegrals found;
  Pcg32 rng(12);
  for (int i = 0; i < 200'000; ++i) {
    const Vec3 w = toTube.toWorld(uniformCone({rng.next(), rng.next()}, kHeight));
    found.add(litPoint(scene, x, w) ? static_cast<double>(kTwoPi * kHeight) : 0, w);
  }
  return found;
}

// At its silhouette the density of directions is infinite, so not cell by cell: by integrals over the directions in
// which its lit side is seen, against directions that are drawn without knowledge of the light.
TEST(Cylinder, LightSamplesHaveTheDensityOfTheirDirections) {
  const Vec3 x(1.5f, -0.5f, 0.3f);
  const SceneSnapshot scene = test::build(tube(1));
  const LitIntegrals truth = fromDirections(*scene, x), own = fromLightSamples(*scene, x),
                     longer = fromLightSamples(*test::build(tube(kTooLong)), x);
  for (int i = 0; i < 2; ++i) {
    const stats::Moments &sampled = own.integrals[i], &uniform = truth.integrals[i];
    EXPECT_GT(stats::welchTest(sampled, uniform), 1e-4) << sampled.mean() << " " << uniform.mean();
    EXPECT_LT(stats::welchTest(longer.integrals[i], uniform), 1e-4) << "the test cannot fail";
  }
}

TEST(Cylinder, WarnsThatAMediumHasNoEnds) {
  const auto warnings = [](const std::string& inside) {
    return test::build("<emitter type=\"constant\"/><shape type=\"cylinder\">" + inside + "</shape>")->warnings;
  };
  const std::string medium = "<medium name=\"interior\" type=\"homogeneous\"/>";
  for (const char* bsdf : {"null", "dielectric"}) {
    const auto found = warnings(fmt::format("<bsdf type=\"{}\"/>", bsdf) + medium);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NE(found[0].find("the cylinder holds a medium and is open: 2 of its edges"), std::string::npos) << found[0];
    EXPECT_TRUE(found[0].starts_with("test.xml:2:")) << found[0];
  }
  EXPECT_TRUE(warnings("<bsdf type=\"null\"/>" + medium + "<medium name=\"exterior\" type=\"homogeneous\"/>").empty());
  EXPECT_TRUE(warnings("").empty());
}

std::string messageOf(const std::string& elements) {
  const auto error = loading::errorOf([&] { test::build(elements); });
  return error ? error->message() : "builds";
}

TEST(Cylinder, BadOnesAreRefused) {
  EXPECT_EQ(messageOf(shape("cylinder", "<point name=\"p1\" x=\"0\" y=\"0\" z=\"0\"/>")),
            "\"p0\" and \"p1\" are the same point");
  EXPECT_EQ(messageOf(shape("cylinder", "<float name=\"radius\" value=\"0\"/>")),
            "\"radius\" is 0; it must be greater than 0");
  EXPECT_EQ(messageOf(shape("cylinder", placed("<scale x=\"1\" y=\"2\" z=\"1\"/>"))),
            "a cylinder's transform must scale evenly and not shear");
  EXPECT_EQ(messageOf(shape("cylinder", placed("<matrix value=\"1 0 0.5 0  0 1 0 0  0 0 1 0  0 0 0 1\"/>"))),
            "a cylinder's transform must not shear it");
  EXPECT_EQ(messageOf(shape("cylinder", placed("<scale x=\"2\" y=\"2\" z=\"5\"/>"))), "builds");
}

// --- Rough and thin

Bsdf bsdfOf(const std::string& type, const std::string& parameters = "") {
  const SceneSnapshot scene =
      test::build("<shape type=\"cube\"><bsdf type=\"" + type + "\">" + parameters + "</bsdf></shape>");
  return scene->view.bsdfs[scene->view.surfaces[0].bsdf].front;
}

TEST(RoughBsdfs, HaveMitsubasDefaultsAndParameters) {
  const Vec3 wo = normalize(Vec3(0.3f, 0.1f, 0.9f)), wi = normalize(Vec3(-0.4f, 0, 0.9f)), down = -wo;
  const auto expectSame = [&](const Bsdf& built, const auto& model) {
    EXPECT_EQ(built.value(wo, wi), model.value(wo, wi));
    EXPECT_EQ(built.value(wo, down), model.value(wo, down));
    EXPECT_EQ(built.pdf(wo, wi), model.pdf(wo, wi));
  };
  const float glass = 1.5046f / 1.000277f;
  const Microfacet standard{Microfacet::Kind::beckmann, Microfacet::Sampling::visible, 0.1f, 0.1f};
  const Rgb none(0.f), one(1.f);
  expectSame(bsdfOf("roughconductor"), RoughConductor{standard, none, one, one});
  expectSame(bsdfOf("roughdielectric"), RoughDielectric{standard, glass, one, one});
  const std::string shape =
      "<string name=\"distribution\" value=\"ggx\"/><float name=\"alpha_u\" value=\"0.2\"/><float name=\"alpha_v\" "
      "value=\"0.4\"/><boolean name=\"sample_visible\" value=\"false\"/>";
  const Microfacet stretched{Microfacet::Kind::ggx, Microfacet::Sampling::all, 0.2f, 0.4f};
  expectSame(bsdfOf("roughconductor", shape + "<string name=\"material\" value=\"Au\"/>"),
             RoughConductor{stretched, Rgb(0.143f, 0.375f, 1.442f), Rgb(3.983f, 2.386f, 1.603f), one});
  expectSame(
      bsdfOf("roughdielectric", shape + "<float name=\"int_ior\" value=\"1.8\"/><float name=\"ext_ior\" value=\"1.2\"/>"
                                        "<rgb name=\"specular_transmittance\" value=\"0.5\"/>"),
      RoughDielectric{stretched, 1.8f / 1.2f, one, Rgb(0.5f)});
  EXPECT_EQ(bsdfOf("conductor").sample(wo, {}, 0).weight, one) << "a mirror, as in Mitsuba 3";
  const BsdfSample straight = bsdfOf("thindielectric").sample(wo, {}, 0x1.fffffep-1f);
  EXPECT_EQ(straight.wi, -wo);
  EXPECT_FLOAT_EQ(straight.pdf, 1 - (ThinDielectric{glass, one, one}.reflectedShare(wo.z)));
}

TEST(RoughBsdfs, BadParametersAreRefused) {
  const auto message = [](const char* type, const std::string& parameters) {
    return messageOf("<shape type=\"cube\"><bsdf type=\"" + std::string(type) + "\">" + parameters + "</bsdf></shape>");
  };
  const auto number = [](const char* name, const char* value) {
    return fmt::format("<float name=\"{}\" value=\"{}\"/>", name, value);
  };
  EXPECT_EQ(message("roughconductor", number("alpha_u", "0.1")), "\"alpha_u\" and \"alpha_v\" come together");
  EXPECT_EQ(message("roughconductor", number("alpha", "0.1") + number("alpha_u", "0.1") + number("alpha_v", "0.1")),
            "give either \"alpha\" or \"alpha_u\" and \"alpha_v\"");
  EXPECT_EQ(message("roughdielectric", number("alpha", "-0.1")), "\"alpha\" is -0.1; it must be at least 0");
  EXPECT_EQ(message("roughdielectric", number("alpha", "0")), "builds");
  EXPECT_EQ(message("roughdielectric", number("int_ior", "1.3") + number("ext_ior", "1.3")),
            "the indices inside and outside are equal: no facet would bend light");
  EXPECT_EQ(message("roughconductor", "<string name=\"distribution\" value=\"phong\"/>"),
            "unknown value \"phong\" of \"distribution\"");
  for (const char* glass : {"roughdielectric", "thindielectric"})
    EXPECT_EQ(message("twosided", fmt::format("<bsdf type=\"{}\"/>", glass)),
              "only bsdfs that reflect can be made twosided");
  EXPECT_EQ(message("twosided", "<bsdf type=\"roughconductor\"/>"), "builds");
}

TEST(RoughBsdfs, LeaveNoLightUnfound) {
  const auto warnings = [](const char* type) {
    return test::build(fmt::format("<emitter type=\"point\"/><shape type=\"sphere\"><bsdf type=\"{}\"/></shape>", type))
        ->warnings.size();
  };
  EXPECT_EQ(warnings("dielectric"), 1u);
  EXPECT_EQ(warnings("thindielectric"), 1u) << "connections look through it, but what it mirrors is not found";
  EXPECT_EQ(warnings("roughdielectric"), 0u);
}

}  // namespace
}  // namespace virga
