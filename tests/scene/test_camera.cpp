// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "scene/scenes.h"
#include "stats/stats.h"

namespace virga {
namespace {

std::string sensor(const std::string& inside, const std::string& film = "", const std::string& filter = "") {
  return fmt::format("<sensor type=\"perspective\">{}<film type=\"hdrfilm\">{}{}</film></sensor>", inside, film,
                     filter);
}

SceneSnapshot seenBy(const std::string& sensorText) { return buildScene(test::describe(sensorText)); }

std::string number(const char* name, double value) {
  return fmt::format("<float name=\"{}\" value=\"{}\"/>", name, value);
}
std::string whole(const char* name, int value) {
  return fmt::format("<integer name=\"{}\" value=\"{}\"/>", name, value);
}

void expectNear(Vec3 a, Vec3 b, float tolerance) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

// A ray through a crop window, with a principal point aside, as another renderer (Mitsuba 3.9) has it.
TEST(Camera, RaysAreThoseOfAnIndependentRenderer) {
  struct Expected {
    const char* axis;
    Vec3 o, d;
    float tMax;
  };
  const Vec3 ox(0.85983962f, 1.86753845f, 2.53627777f), dx(-0.27907932f, -0.26374984f, -0.92333686f);
  const Vec3 oy(0.84673971f, 1.88677812f, 2.53233790f), dy(-0.30349126f, -0.22420585f, -0.92608035f);
  const Expected all[] = {
      {"x", ox, dx, 19.586744f},
      {"y", oy, dy, 19.694639f},
      {"diagonal", {0.86423987f, 1.86107588f, 2.53760123f}, {-0.27068606f, -0.27699467f, -0.92195612f}, 19.560094f},
      {"smaller", oy, dy, 19.694639f},
      {"larger", ox, dx, 19.586744f}};
  for (const Expected& e : all) {
    const SceneSnapshot scene =
        seenBy(sensor(number("fov", 40) + fmt::format("<string name=\"fov_axis\" value=\"{}\"/>", e.axis) +
                          number("near_clip", 0.5) + number("far_clip", 20) + number("principal_point_offset_x", 0.1) +
                          number("principal_point_offset_y", -0.05) +
                          "<transform name=\"to_world\"><lookat origin=\"1, 2, 3\" target=\"0, 0.5, -1\" up=\"0, 1, "
                          "0\"/></transform>",
                      whole("width", 120) + whole("height", 80) + whole("crop_offset_x", 30) +
                          whole("crop_offset_y", 10) + whole("crop_width", 40) + whole("crop_height", 50)));
    const CameraRay r = scene->camera.ray(10.25f, 20.5f);
    SCOPED_TRACE(e.axis);
    expectNear(r.ray.o, e.o, 2e-6f);
    expectNear(r.ray.d, e.d, 2e-6f);
    EXPECT_NEAR(r.tMax, e.tMax, 1e-4f);
    EXPECT_EQ(scene->camera.width, 40);
    EXPECT_EQ(scene->camera.height, 50);
  }
}

TEST(Camera, CornersByHand) {
  const SceneSnapshot scene = seenBy(sensor(number("fov", 90), whole("width", 200) + whole("height", 100)));
  const PerspectiveCamera& c = scene->camera;
  // Half the width spans 45 degrees; +x points left, +y up.
  expectNear(c.ray(0, 0).ray.d, normalize(Vec3(1, 0.5f, 1)), 1e-6f);
  expectNear(c.ray(200, 100).ray.d, normalize(Vec3(-1, -0.5f, 1)), 1e-6f);
  expectNear(c.ray(100, 50).ray.d, {0, 0, 1}, 1e-6f);
  const CameraRay corner = c.ray(0, 0);
  EXPECT_NEAR(corner.ray.o.z, 1e-2f, 1e-8f) << "on the near plane";
  EXPECT_NEAR(corner.ray.at(corner.tMax).z, 1e4f, 1e-2f) << "to the far plane";
}

TEST(Camera, ProjectsWhatItsRaysMeet) {
  const SceneSnapshot scene = seenBy(sensor(
      number("fov", 50) + number("principal_point_offset_x", 0.1) +
          "<transform name=\"to_world\"><scale value=\"3\"/><lookat origin=\"1, 2, 3\" target=\"0, 0.5, -1\" up=\"0, "
          "1, 0\"/></transform>",
      whole("width", 120) + whole("height", 80) + whole("crop_offset_x", 30) + whole("crop_offset_y", 10)));
  for (const Vec2 pixel : {Vec2{0.5f, 0.5f}, Vec2{33, 12}, Vec2{70, 69}}) {
    const Ray ray = scene->camera.ray(pixel.x, pixel.y).ray;
    Vec2 at;
    ASSERT_TRUE(scene->camera.project(ray.at(7), at));
    EXPECT_NEAR(at.x, pixel.x, 1e-3f);
    EXPECT_NEAR(at.y, pixel.y, 1e-3f);
    EXPECT_FALSE(scene->camera.project(ray.at(-7), at)) << "behind the eye";
  }
}

TEST(Camera, PortraitFilms) {
  const auto tangents = [](const char* axis) {
    const SceneSnapshot scene =
        seenBy(sensor(number("fov", 90) + fmt::format("<string name=\"fov_axis\" value=\"{}\"/>", axis),
                      whole("width", 100) + whole("height", 200)));
    return Vec2{scene->camera.tanX, scene->camera.tanY};
  };
  EXPECT_NEAR(tangents("smaller").x, 1, 1e-6);
  EXPECT_NEAR(tangents("smaller").y, 2, 1e-6);
  EXPECT_NEAR(tangents("larger").y, 1, 1e-6);
  EXPECT_NEAR(tangents("larger").x, 0.5, 1e-6);
}

TEST(Camera, FocalLengthIsThatOf35mmFilm) {
  const SceneSnapshot scene =
      seenBy(sensor("<string name=\"focal_length\" value=\"50mm\"/>", whole("width", 300) + whole("height", 200)));
  EXPECT_NEAR(scene->camera.tanX, 36.0 / 100, 1e-5);
  EXPECT_NEAR(scene->camera.tanY, 24.0 / 100, 1e-5);
}

TEST(Camera, ScaleInItsTransformChangesNothing) {
  const SceneSnapshot plain = seenBy(sensor(number("fov", 50)));
  const SceneSnapshot scaled =
      seenBy(sensor(number("fov", 50) + "<transform name=\"to_world\"><scale value=\"3\"/></transform>"));
  expectNear(plain->camera.ray(10, 20).ray.o, scaled->camera.ray(10, 20).ray.o, 1e-7f);
  expectNear(plain->camera.ray(10, 20).ray.d, scaled->camera.ray(10, 20).ray.d, 1e-6f);
}

TEST(Camera, AnotherFilmSizeTakesTheCropWindowAlong) {
  const SceneDescription d = test::describe(
      sensor(number("fov", 90), whole("width", 100) + whole("height", 100) + whole("crop_offset_x", 50)));
  EXPECT_EQ(buildScene(d)->camera.width, 50);
  const SceneSnapshot scene = buildScene(d, {.filmSize = std::pair(64, 32)});
  EXPECT_EQ(scene->camera.filmWidth, 64);
  EXPECT_EQ(scene->camera.width, 32);
  EXPECT_EQ(scene->camera.height, 32);
  EXPECT_EQ(scene->camera.cropX, 32);
  EXPECT_NEAR(scene->camera.tanY, 0.5, 1e-6);
}

PixelFilter filterOf(const std::string& text) { return seenBy(sensor(number("fov", 40), "", text))->filter; }

double filterP(const PixelFilter& filter, double radius, const std::function<double(double)>& weight) {
  const double total = stats::integrateInterval(weight, -radius, radius);
  return stats::chiSquaredInterval(
      {.cells = 100, .lo = -radius, .hi = radius, .samples = 400'000},
      [&](float u) -> std::optional<double> {
        return static_cast<double>(filter.sample({u, 0.5f}).x);
      },
      [&](double x) { return std::fabs(x) < radius ? weight(x) / total : 0.0; });
}

TEST(PixelFilter, SamplesFollowTheFilter) {
  const auto box = [](double) { return 1.0; };
  const auto tent = [](double r) { return [r](double x) { return r - std::fabs(x); }; };
  const auto gaussian = [](double s) {
    return [s](double x) { return std::exp(-x * x / (2 * s * s)) - std::exp(-8.0); };
  };
  const PixelFilter byDefault = filterOf(""), boxFilter = filterOf("<rfilter type=\"box\"/>");
  const PixelFilter tentFilter = filterOf("<rfilter type=\"tent\"><float name=\"radius\" value=\"1.5\"/></rfilter>");
  const PixelFilter wide = filterOf("<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.8\"/></rfilter>");
  EXPECT_GT(filterP(boxFilter, 0.5, box), 1e-4);
  EXPECT_LT(filterP(boxFilter, 0.51, box), 1e-4);
  EXPECT_GT(filterP(tentFilter, 1.5, tent(1.5)), 1e-4);
  EXPECT_LT(filterP(tentFilter, 1.5, tent(1.53)), 1e-4);
  EXPECT_GT(filterP(byDefault, 2, gaussian(0.5)), 1e-4);
  EXPECT_LT(filterP(byDefault, 2, gaussian(0.51)), 1e-4);
  EXPECT_GT(filterP(wide, 3.2, gaussian(0.8)), 1e-4);
  EXPECT_LT(filterP(wide, 3.2, gaussian(0.78)), 1e-4);
}

TEST(PixelFilter, StaysInItsRadiusAndIsSymmetric) {
  for (const char* text : {"<rfilter type=\"box\"/>", "<rfilter type=\"tent\"/>", "<rfilter type=\"gaussian\"/>"}) {
    const PixelFilter filter = filterOf(text);
    for (const float u : {0.f, 0x1p-24f, 0.1f, 0.25f, 0.5f, 0.75f, 0x1.fffffep-1f}) {
      const float x = filter.sample({u, 0.5f}).x;
      EXPECT_LE(std::fabs(x), filter.radius) << text;
      EXPECT_NEAR(x, -filter.sample({1 - u, 0.5f}).x, 1e-6f) << text << " " << u;
    }
    EXPECT_EQ(filter.sample({0.2f, 0.7f}).y, filter.sample({0.7f, 0.2f}).x);
    EXPECT_NEAR(filter.sample({0.5f, 0.5f}).x, 0, 1e-6) << text;
  }
}

}  // namespace
}  // namespace virga
