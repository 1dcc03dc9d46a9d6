// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "core/random.h"
#include "image/image_io.h"
#include "image/scratch.h"
#include "scene/scenes.h"
#include "stats/stats.h"

namespace virga {
namespace {

constexpr double kPiDouble = 3.14159265358979324;

std::string areaLight(const std::string& shape, const std::string& inside) {
  return fmt::format(
      "<shape type=\"{}\">{}<emitter type=\"area\"><rgb name=\"radiance\" value=\"2, 3, 4\"/></emitter></shape>", shape,
      inside);
}

std::string transform(const std::string& steps) { return "<transform name=\"to_world\">" + steps + "</transform>"; }

/// A light, and points from which it is seen.
struct Case {
  std::string name, elements;
  std::vector<Vec3> receivers;
};

std::string matrix(const Matrix4& m) { return transform(fmt::format("<matrix value=\"{}\"/>", fmt::join(m.m, " "))); }

Matrix4 skewed() { return Matrix4::rotation(0, 1, 0, 30) * Matrix4::scaling(0.5, 1.5, 1); }
Matrix4 turned() { return Matrix4::rotation(1, 2, 0.3, 40) * Matrix4::scaling(0.7, 0.7, 0.7); }

constexpr float kRadius = 0.5f;
constexpr Vec3 kCenter(0.2f, 0, 0);
constexpr const char* kSphere =
    "<float name=\"radius\" value=\"0.5\"/><point name=\"center\" x=\"0.2\" y=\"0\" z=\"0\"/>";
constexpr const char* kInward = "<boolean name=\"flip_normals\" value=\"true\"/>";

std::vector<Case> areaLights() {
  const std::vector<Vec3> around{{0, 0, 3}, {1, -2, 1.5f}, {0.3f, 0.4f, 1}, {-40, 10, 70}};
  return {{"rectangle", areaLight("rectangle", matrix(skewed())), around},
          {"disk", areaLight("disk", matrix(turned())), around},
          {"cube", areaLight("cube", matrix(turned())), {{0, 0, 3}, {1, -2, 1.5f}, {-40, 10, 70}}},
          {"sphere", areaLight("sphere", kSphere), {{0, 0, 3}, {0.2f, 0.1f, 0.55f}, {0.2f, 0, 0.5001f}, {30, 20, -70}}},
          {"sphere, from within",
           areaLight("sphere", std::string(kSphere) + kInward),
           {{0.2f, 0, 0}, {0.3f, 0.1f, -0.2f}, {0.2f, 0.499f, 0}}}};
}

/// What a ray from x meets of the light, if it faces x.
std::optional<SurfacePoint> seen(const Scene& scene, Vec3 x, Vec3 w) {
  const Ray ray{x, w};
  const RayHit hit = scene.surfaceRays->nearest(ray, 0, kInfinity);
  if (!hit.found()) return std::nullopt;
  const SurfacePoint p = surfacePoint(scene.view.surfaces[hit.shape], ray, hit, scene.view.scale);
  return dot(p.geometricNormal, w) < 0 ? std::optional(p) : std::nullopt;
}

/// Names the directions toward a light by points of the unit square: no density has an edge there.
struct Chart {
  std::function<Vec3(Vec2)> direction;
  std::function<Vec2(Vec3)> square;
  std::function<float(Vec3)> stretch;  ///< solid angle per area of the square, at a direction
};

double samplingP(const Scene& scene, Vec3 x, const Chart& chart, Vec3 claimedFrom, float claimedShare = 1) {
  const EmitterView& emitter = scene.view.emitters[0];
  return stats::chiSquaredSquare(
      {.samples = 100'000},
      [&](Vec2 u) -> std::optional<Vec2> {
        const LightSample s = sampleLight(scene.view, emitter, x, u);
        if (!(s.pdf > 0)) return std::nullopt;
        return chart.square(s.wi);
      },
      [&](Vec2 u) -> double {
        const Vec3 w = chart.direction(u);
        const auto p = seen(scene, x, w);
        if (!p) return 0;
        const ShapeView& shape = scene.view.surfaces[emitter.shape];
        return static_cast<double>(claimedShare * chart.stretch(w) *
                                   areaLightPdf(shape, emitter, claimedFrom, p->p, p->geometricNormal));
      });
}

/// A chart by points of the light: `point` from the square and back, both keeping areas up to a factor.
Chart chartOf(const Scene& scene, Vec3 x, std::function<Vec3(Vec2)> point, std::function<Vec2(Vec3)> back) {
  return {[=](Vec2 u) { return normalize(point(u) - x); },
          [=, &scene](Vec3 w) {
            const auto p = seen(scene, x, w);
            return p ? back(p->p) : Vec2{-1, -1};
          },
          [=, &scene](Vec3 w) {
            const auto p = seen(scene, x, w);
            return -dot(p->geometricNormal, w) / lengthSquared(p->p - x) * scene.view.emitters[0].area;
          }};
}

float turn(float y, float x) {
  const float angle = std::atan2(y, x) / kTwoPi;
  return angle < 0 ? angle + 1 : angle;
}

void expectFollows(const Case& c, const std::function<Chart(const Scene&, Vec3)>& chart, bool another) {
  const SceneSnapshot scene = test::build(c.elements);
  for (const Vec3& x : c.receivers) {
    if (length(x) > 20) continue;  // directions are too coarse to tell points of the light apart
    SCOPED_TRACE(fmt::format("{} from {} {} {}", c.name, x.x, x.y, x.z));
    EXPECT_GT(samplingP(*scene, x, chart(*scene, x), x), 1e-4);
    EXPECT_LT(samplingP(*scene, x, chart(*scene, x), x, 0.97f), 1e-4) << "the test cannot fail";
    if (another) {
      EXPECT_LT(samplingP(*scene, x, chart(*scene, x), x + Vec3(0.1f, 0.05f, 0.1f)), 1e-4) << "the test cannot fail";
    }
  }
}

TEST(AreaLight, DirectionsFollowTheDensity) {
  const std::vector<Case> cases = areaLights();
  const Affine rectangle(skewed()), toRectangle(skewed().inverse()), disk(turned()), toDisk(turned().inverse());
  expectFollows(
      cases[0],
      [&](const Scene& scene, Vec3 x) {
        return chartOf(
            scene, x,
            [=](Vec2 u) {
              return rectangle.point({2 * u.x - 1, 2 * u.y - 1, 0});
            },
            [=](Vec3 p) {
              return Vec2{0.5f + 0.5f * toRectangle.point(p).x, 0.5f + 0.5f * toRectangle.point(p).y};
            });
      },
      true);
  expectFollows(
      cases[1],
      [&](const Scene& scene, Vec3 x) {
        return chartOf(
            scene, x, [=](Vec2 u) { return disk.point(sphericalDirection(std::sqrt(u.x), 0, kTwoPi * u.y)); },
            [=](Vec3 p) {
              const Vec3 q = toDisk.point(p);
              return Vec2{q.x * q.x + q.y * q.y, turn(q.y, q.x)};
            });
      },
      true);
  expectFollows(
      cases[3],
      [&](const Scene&, Vec3 x) {
        const Frame frame(normalize(kCenter - x));
        const float height = coneHeight(kRadius, distance(x, kCenter));
        return Chart{[=](Vec2 u) {
                       return frame.toWorld(uniformCone({u.x, u.y}, height));
                     },
                     [=](Vec3 w) {
                       const Vec3 v = frame.toLocal(w);
                       return Vec2{(1 - v.z) / height, turn(v.y, v.x)};
                     },
                     [=](Vec3) { return kTwoPi * height; }};
      },
      false);
  expectFollows(
      cases[4],
      [&](const Scene& scene, Vec3 x) {
        return chartOf(
            scene, x, [=](Vec2 u) { return kCenter + uniformSphere(u) * kRadius; },
            [=](Vec3 p) {
              const Vec3 n = (p - kCenter) / kRadius;
              return Vec2{0.5f * (1 - n.z), turn(n.y, n.x)};
            });
      },
      true);
}

TEST(AreaLight, ReportsTheDensityThatItsPdfFunctionsGive) {
  for (const Case& c : areaLights()) {
    const SceneSnapshot scene = test::build(c.elements);
    const EmitterView& emitter = scene->view.emitters[0];
    for (const Vec3& x : c.receivers) {
      Pcg32 random(3);
      int valid = 0;
      for (int i = 0; i < 2000; ++i) {
        const LightSample s = sampleLight(scene->view, emitter, x, {random.next(), random.next()});
        if (!(s.pdf > 0)) continue;
        ASSERT_NEAR(length(s.wi), 1, 1e-5);
        ASSERT_FALSE(s.delta);
        ASSERT_EQ(s.radiance, Rgb(2, 3, 4));
        const auto p = seen(*scene, x, s.wi);
        if (!p) continue;  // an edge, missed by rounding; or another side of the cube
        if (std::fabs(distance(p->p, x) - s.distance) > 1e-3f * s.distance) continue;
        const float cosine = std::fabs(dot(p->geometricNormal, s.wi));
        if (cosine < 0.02f) continue;
        ++valid;
        const ShapeView& shape = scene->view.surfaces[emitter.shape];
        const float far = length(x) > 20 ? 3e-2f : 3e-3f;  // the hit point's normal has lost digits
        ASSERT_NEAR(s.pdf / areaLightPdf(shape, emitter, x, p->p, p->geometricNormal), 1, far) << c.name;
        ASSERT_NEAR(s.uniformPdf / uniformPointPdf(emitter, x, p->p, p->geometricNormal), 1, far / cosine) << c.name;
      }
      EXPECT_GT(valid, 300) << c.name << " " << x.z;
    }
  }
}

TEST(AreaLight, PointsAreUniform) {
  for (const Case& c : areaLights()) {
    const SceneSnapshot scene = test::build(c.elements);
    const EmitterView& emitter = scene->view.emitters[0];
    const ShapeView& shape = scene->view.surfaces[0];
    stats::Moments x;
    Pcg32 random(4);
    for (int i = 0; i < 20'000; ++i) {
      const LightPoint p = sampleLightPoint(scene->view, emitter, {random.next(), random.next()});
      ASSERT_NEAR(p.areaPdf * emitter.area, 1, 1e-6);
      ASSERT_NEAR(length(p.normal), 1, 1e-5);
      x.add(static_cast<double>(p.p.x));
    }
    const double center = shape.kind == ShapeView::Kind::mesh ? 0 : static_cast<double>(shape.center.x);
    EXPECT_GT(stats::zTest(x.mean(), center, x.standardError()), 1e-4) << c.name;
  }
}

/// Mean of radiance * cosine / density over samples: the irradiance of a receiver with normal n.
stats::Moments irradiance(const Scene& scene, Vec3 x, Vec3 n, int count = 400'000) {
  stats::Moments m;
  Pcg32 random(5);
  for (int i = 0; i < count; ++i) {
    const LightSample s = sampleLight(scene.view, scene.view.emitters[0], x, {random.next(), random.next()});
    const float cosine = s.pdf > 0 ? std::max(0.f, dot(s.wi, n)) : 0;
    m.add(s.pdf > 0 ? static_cast<double>(s.radiance.r * cosine / s.pdf) : 0);
  }
  return m;
}

void expectIrradiance(const Scene& scene, Vec3 x, Vec3 n, double truth, const std::string& name) {
  const stats::Moments m = irradiance(scene, x, n);
  // Where next to nothing varies, single precision remains.
  const double error = std::max(m.standardError(), 3e-6 * truth);
  EXPECT_GT(stats::zTest(m.mean(), truth, error), 1e-4) << name << ": " << m.mean() << " instead of " << truth;
  EXPECT_LT(stats::zTest(m.mean(), 1.03 * truth, error), 1e-4) << name << ": the test cannot fail";
}

TEST(AreaLight, GivesTheKnownIrradiance) {
  const SceneSnapshot sphere = test::build(areaLight("sphere", "<float name=\"radius\" value=\"0.5\"/>"));
  for (const float d : {0.50001f, 0.6f, 2.f, 100.f, 1e4f, 1e6f}) {
    const double share = 0.25 / (static_cast<double>(d) * static_cast<double>(d));
    expectIrradiance(*sphere, {0, 0, d}, {0, 0, -1}, 2 * kPiDouble * share, fmt::format("sphere from {}", d));
  }
  const SceneSnapshot disk = test::build(areaLight("disk", ""));
  for (const double d : {0.3, 1.0, 30.0})
    expectIrradiance(*disk, {0, 0, static_cast<float>(d)}, {0, 0, -1}, 2 * kPiDouble / (1 + d * d),
                     fmt::format("disk from {}", d));
  // Four corner rectangles of side 1, seen from above their common corner.
  const SceneSnapshot square = test::build(areaLight("rectangle", ""));
  for (const double d : {0.3, 1.0, 20.0}) {
    const double a = 1 / std::sqrt(1 + d * d);
    expectIrradiance(*square, {0, 0, static_cast<float>(d)}, {0, 0, -1}, 2 * 4 * a * std::atan(a),
                     fmt::format("square from {}", d));
  }
  const SceneSnapshot inside = test::build(areaLight("sphere", "<boolean name=\"flip_normals\" value=\"true\"/>"));
  for (const Vec3 x : {Vec3(0), Vec3(0.3f, -0.4f, 0.1f), Vec3(0, 0, 0.7f)})
    expectIrradiance(*inside, x, normalize(Vec3(1, 2, 3)), 2 * kPiDouble, "within a sphere");
}

TEST(AreaLight, IsBlackFromBehindAndFinitelySampledOnItsSurface) {
  const SceneSnapshot disk = test::build(areaLight("disk", ""));
  const SceneSnapshot sphere = test::build(areaLight("sphere", ""));
  Pcg32 random(6);
  for (int i = 0; i < 1000; ++i) {
    const Vec2 u{random.next(), random.next()};
    EXPECT_EQ(sampleLight(disk->view, disk->view.emitters[0], {0, 0, -1}, u).pdf, 0);
    EXPECT_EQ(sampleLight(disk->view, disk->view.emitters[0], {0.1f, 0.2f, 0}, u).pdf, 0) << "in its plane";
    EXPECT_EQ(sampleLight(sphere->view, sphere->view.emitters[0], {0.2f, 0, 0}, u).pdf, 0) << "within, from behind";
    for (const float d : {1.f, 0x1.000002p0f, 1.0005f, 1.002f}) {
      const LightSample s = sampleLight(sphere->view, sphere->view.emitters[0], {0, 0, d}, u);
      ASSERT_TRUE(s.pdf >= 0 && std::isfinite(s.pdf) && std::isfinite(s.uniformPdf) && isFinite(s.wi)) << d;
      ASSERT_TRUE(s.pdf == 0 || s.distance >= 0) << d;
    }
  }
}

TEST(SphereLight, FarAwayItsUniformDensityIsStillExact) {
  const SceneSnapshot scene = test::build(areaLight("sphere", "<float name=\"radius\" value=\"0.5\"/>"));
  Pcg32 random(7);
  for (const float d : {10.f, 1e4f, 1e7f}) {
    // The mean of 1 / density over samples of the cone, times the cone's own, is a ratio of integrals that is known:
    // E[uniform / cone] = 1, as both integrate to 1 (the far half of a uniform sphere is not seen: a half).
    stats::Moments m;
    for (int i = 0; i < 20'000; ++i) {
      const LightSample s =
          sampleLight(scene->view, scene->view.emitters[0], {0, 0, d}, {random.next(), random.next()});
      m.add(static_cast<double>(s.pdf / s.uniformPdf));
    }
    // cone / uniform = area cos / (solid angle d^2) up to (d - r) / d: its mean is 4 * 2/3 for d >> r.
    const double r = 0.5 / static_cast<double>(d);
    EXPECT_NEAR(m.mean(), 8.0 / 3, 0.02 + 5 * r) << d;
  }
}

TEST(PointLight, FallsWithTheSquare) {
  const SceneSnapshot scene = test::build(
      "<emitter type=\"point\"><point name=\"position\" x=\"1\" y=\"2\" z=\"3\"/><rgb name=\"intensity\" value=\"8, 4, "
      "2\"/></emitter>");
  const LightSample s = sampleLight(scene->view, scene->view.emitters[0], {1, 2, -1}, {0.3f, 0.4f});
  EXPECT_TRUE(s.delta);
  EXPECT_EQ(s.pdf, 1);
  EXPECT_EQ(s.wi, Vec3(0, 0, 1));
  EXPECT_EQ(s.distance, 4);
  EXPECT_EQ(s.radiance, Rgb(0.5f, 0.25f, 0.125f));
  EXPECT_EQ(sampleLight(scene->view, scene->view.emitters[0], {1, 2, 3}, {0.3f, 0.4f}).pdf, 0) << "at the light itself";
}

TEST(SpotLight, FallsLinearlyFromBeamToCutoff) {
  const SceneSnapshot scene = test::build(
      "<emitter type=\"spot\"><transform name=\"to_world\"><lookat origin=\"0, 0, 5\" target=\"0, 0, 0\" up=\"0, 1, "
      "0\"/></transform>"
      "<float name=\"cutoff_angle\" value=\"30\"/><float name=\"beam_width\" value=\"10\"/></emitter>");
  const auto at = [&](double degrees) {
    const auto x = static_cast<float>(5 * std::tan(degrees * kPiDouble / 180));
    const LightSample s = sampleLight(scene->view, scene->view.emitters[0], {x, 0, 0}, {});
    return static_cast<double>(s.radiance.r * s.distance * s.distance);
  };
  EXPECT_NEAR(at(0), 1, 1e-5);
  EXPECT_NEAR(at(9.9), 1, 1e-5);
  EXPECT_NEAR(at(15), 0.75, 1e-4);
  EXPECT_NEAR(at(25), 0.25, 1e-4);
  EXPECT_EQ(at(30.1), 0);
  EXPECT_EQ(sampleLight(scene->view, scene->view.emitters[0], {0, 0, 9}, {}).radiance, Rgb()) << "behind it";
}

TEST(DirectionalLight, ComesFromWhereItGoesNot) {
  const SceneSnapshot scene =
      test::build("<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"-2\" z=\"0\"/></emitter>");
  const LightSample s = sampleLight(scene->view, scene->view.emitters[0], {7, 8, 9}, {});
  EXPECT_EQ(s.wi, Vec3(0, 1, 0));
  EXPECT_EQ(s.distance, kInfinity);
  EXPECT_EQ(s.radiance, Rgb(1.f));
  EXPECT_TRUE(s.delta && s.pdf == 1);
}

TEST(ConstantLight, SurroundsEverything) {
  const SceneSnapshot scene = test::build("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"2\"/></emitter>");
  const EmitterView& e = scene->view.emitters[0];
  EXPECT_EQ(scene->view.environment, 0);
  const auto p = [&](double factor) {
    return stats::chiSquared(
        {}, [&](Vec2 u) { return sampleLight(scene->view, e, {}, u).wi; },
        [&](Vec3 w) { return factor * static_cast<double>(environmentPdf(e, w)); });
  };
  EXPECT_GT(p(1), 1e-4);
  EXPECT_LT(p(0.98), 1e-4) << "the test cannot fail";
  expectIrradiance(*scene, {}, {0, 0, 1}, 2 * kPiDouble, "constant");
}

/// A scene around which a picture stands.
class Surroundings {
 public:
  explicit Surroundings(const Image& image, const std::string& inside = "") {
    const std::filesystem::path path = scratchFile("surroundings.exr");
    writeExr(path, image);
    scene = test::build(fmt::format("<emitter type=\"envmap\"><string name=\"filename\" value=\"{}\"/>{}</emitter>",
                                    path.string(), inside));
  }
  const EmitterView& emitter() const { return scene->view.emitters[0]; }

  SceneSnapshot scene;
};

Image noisy(int width, int height) {
  Image image(width, height);
  Pcg32 random(8);
  for (Rgb& p : image.pixels)
    p = Rgb(random.next(), random.next(), random.next()) * (random.next() < 0.1f ? 20.f : 1.f);
  return image;
}

Image onePixel(int width, int height, int x, int y) {
  Image image(width, height);
  image.at(x, y) = Rgb(100, 50, 25);
  return image;
}

double environmentP(const Surroundings& s, double factor) {
  return stats::chiSquared(
      {.axis = {0, 1, 0}}, [&](Vec2 u) { return sampleLight(s.scene->view, s.emitter(), {}, u).wi; },
      [&](Vec3 w) { return factor * static_cast<double>(environmentPdf(s.emitter(), w)); });
}

TEST(EnvironmentMap, DirectionsFollowTheDensity) {
  const std::string turned = transform("<rotate x=\"1\" y=\"0.4\" z=\"-0.2\" angle=\"130\"/>");
  const Image images[] = {noisy(32, 16), noisy(7, 5), onePixel(32, 16, 20, 3), onePixel(16, 8, 0, 0),
                          Image(1, 1, Rgb(1.f))};
  for (const Image& image : images) {
    const Surroundings s(image);
    EXPECT_GT(environmentP(s, 1), 1e-4) << image.width;
    EXPECT_LT(environmentP(s, 0.98), 1e-4) << image.width << ": the test cannot fail";
    const Surroundings rotated(image, turned);
    EXPECT_NEAR(stats::integrateSphere([&](Vec3 w) { return environmentPdf(rotated.emitter(), w); }, {0, 1, 0}, 1e-4),
                1, 5e-3);
  }
}

TEST(EnvironmentMap, ReportsWhatItsFunctionsGiveAndMissesNoLight) {
  for (const Image& image : {noisy(32, 16), onePixel(32, 16, 20, 3)}) {
    const Surroundings s(image, transform("<rotate y=\"1\" angle=\"77\"/>"));
    Pcg32 random(9);
    for (int i = 0; i < 20'000; ++i) {
      const LightSample light = sampleLight(s.scene->view, s.emitter(), {}, {random.next(), random.next()});
      ASSERT_NEAR(length(light.wi), 1, 1e-5);
      ASSERT_EQ(light.radiance, environmentRadiance(s.emitter(), light.wi));
      const float pdf = environmentPdf(s.emitter(), light.wi);
      // On the border of two pixels the direction may round to the other one.
      if (std::fabs(light.pdf / pdf - 1) > 1e-3f) {
        const float near =
            environmentPdf(s.emitter(), normalize(light.wi + uniformSphere({random.next(), random.next()}) * 1e-5f));
        ASSERT_TRUE(near > 0 || pdf > 0);
      }
      const Vec3 w = uniformSphere({random.next(), random.next()});
      if (!isBlack(environmentRadiance(s.emitter(), w))) {
        ASSERT_GT(environmentPdf(s.emitter(), w), 0);
      }
    }
    for (const Vec3 n : {Vec3(0, 0, 1), normalize(Vec3(1, -2, 0.5f))}) {
      const double truth = stats::integrateSphere(
          [&](Vec3 w) { return static_cast<double>(environmentRadiance(s.emitter(), w).r * std::max(0.f, dot(w, n))); },
          {0, 1, 0}, 1e-4);
      if (truth > 1e-3) expectIrradiance(*s.scene, {}, n, truth, "environment");
    }
  }
}

// u = 0 at -z, 0.25 at +x, 0.5 at +z; v = 0 at +y.
TEST(EnvironmentMap, LooksTheWayOthersDo) {
  Image image(8, 4);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 8; ++x) image.at(x, y) = Rgb(static_cast<float>(x), static_cast<float>(y), 1);
  const Surroundings s(image, "<float name=\"scale\" value=\"2\"/>");
  const auto at = [&](Vec3 w) { return environmentRadiance(s.emitter(), normalize(w)) / 2; };
  EXPECT_NEAR(at({1, 0, 0}).r, 1.5f, 1e-4f) << "between the centres of columns 1 and 2";
  EXPECT_NEAR(at({0, 0, 1}).r, 3.5f, 1e-4f);
  EXPECT_NEAR(at({-1, 0, 0}).r, 5.5f, 1e-4f);
  EXPECT_NEAR(at({0, 0, -1}).r, 3.5f, 1e-4f) << "between columns 7 and 0";
  EXPECT_NEAR(at({1e-3f, 1, 0}).g, 0, 1e-2f);
  EXPECT_NEAR(at({1e-3f, -1, 0}).g, 3, 1e-2f);
  EXPECT_NEAR(at({1, 0, 0}).g, 1.5f, 1e-4f);
  EXPECT_NEAR(at({1, 1, 0}).g, 0.75f, 1e-4f) << "the first row is the pole";
  // A turn by 90 degrees about y takes what was at +x to -z.
  const Surroundings turned(image, transform("<rotate y=\"1\" angle=\"90\"/>"));
  EXPECT_NEAR(environmentRadiance(turned.emitter(), {0, 0, -1}).r, 1.5f, 1e-3f);
}

TEST(EnvironmentMap, AllBlackIsNeverChosen) {
  const Surroundings s(Image(8, 4));
  EXPECT_EQ(environmentPdf(s.emitter(), {0, 0, 1}), 0);
  EXPECT_EQ(environmentRadiance(s.emitter(), {0, 0, 1}), Rgb());
  EXPECT_EQ(s.scene->view.emitterChoice.probability(0), 0);
}

TEST(EmitterChoice, IsByPower) {
  const SceneSnapshot scene = test::build(
      "<emitter type=\"point\"><rgb name=\"intensity\" value=\"3\"/></emitter>"
      "<emitter type=\"point\"><rgb name=\"intensity\" value=\"1\"/></emitter>"
      "<emitter type=\"point\"><rgb name=\"intensity\" value=\"0\"/></emitter>");
  EXPECT_NEAR(scene->view.emitterChoice.probability(0), 0.75, 1e-6);
  EXPECT_NEAR(scene->view.emitterChoice.probability(1), 0.25, 1e-6);
  EXPECT_EQ(scene->view.emitterChoice.probability(2), 0);
}

}  // namespace
}  // namespace virga
