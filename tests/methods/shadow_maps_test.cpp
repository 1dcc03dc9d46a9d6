// SPDX-License-Identifier: Apache-2.0
// Octahedral shadow maps of virtual lights, against rays.
#include "methods/instant_scattering/shadow_maps.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "core/random.h"
#include "core/warp.h"
#include "methods/rendering.h"
#include "transport/visibility.h"

namespace virga {
namespace {

TEST(Octahedron, DirectionsComeBack) {
  Pcg32 random(1);
  for (int i = 0; i < 10000; ++i) {
    const Vec3 w = uniformSphere({random.next(), random.next()});
    const Vec2 q = toOctahedron(w * (0.01f + 100 * random.next()));
    EXPECT_LE(std::max(std::fabs(q.x), std::fabs(q.y)), 1);
    EXPECT_LT(distance(fromOctahedron(q), w), 1e-6f);
  }
  for (int axis = 0; axis < 3; ++axis)
    for (const float sign : {-1.f, 1.f}) {
      Vec3 w;
      w[axis] = sign;
      EXPECT_LT(distance(fromOctahedron(toOctahedron(w)), w), 1e-6f);
    }
}

TEST(Octahedron, TexelsHoldTheirMiddles) {
  for (const int resolution : {1, 2, 7, 16})
    for (int y = 0; y < resolution; ++y)
      for (int x = 0; x < resolution; ++x) {
        if (resolution % 2 == 1 && (x == resolution / 2 || y == resolution / 2)) continue;  // on a fold: of either side
        const OctahedralTexel t = octahedralTexel(octahedralDirection({x, y}, resolution), resolution);
        EXPECT_TRUE(t.x == x && t.y == y) << resolution << ": " << x << " " << y;
      }
}

// Neighbours on the square, also across its borders, are neighbours on the sphere; along neither axis does a place move
// by more than its direction turns.
TEST(Octahedron, GoesOnAcrossItsBorders) {
  const int n = 64;
  for (int i = 0; i < n; ++i)
    for (const OctahedralTexel beside : {OctahedralTexel{-1, i}, {n, i}, {i, -1}, {i, n}, {-3, i}}) {
      const OctahedralTexel inside{std::clamp(beside.x, 0, n - 1), std::clamp(beside.y, 0, n - 1)};
      const Vec3 a = octahedralDirection(wrapOctahedral(beside, n), n), b = octahedralDirection(inside, n);
      EXPECT_LT(distance(a, b), beside.x == -3 ? 0.25f : 0.1f) << beside.x << " " << beside.y;
    }
}
TEST(Octahedron, PlacesMoveNoFasterThanDirectionsTurn) {
  Pcg32 random(2);
  float fastest = 0, above = 0, below = 0;
  for (int i = 0; i < 100000; ++i) {
    const Vec3 a = uniformSphere({random.next(), random.next()});
    const Vec3 b = normalize(a + uniformSphere({random.next(), random.next()}) * 1e-3f);
    if (a.x * b.x < 0 || a.y * b.y < 0 || a.z * b.z < 0) continue;  // it may go on beyond a border
    const Vec2 moved = toOctahedron(a) - toOctahedron(b);
    const float speed = std::max(std::fabs(moved.x), std::fabs(moved.y)) / distance(a, b);
    fastest = std::max(fastest, speed);
    above = std::max(above, speed / octahedralSpeed(a));
    below = std::max(below, octahedralSpeed(a) / kOctahedralSpeed);
  }
  EXPECT_NEAR(fastest, kOctahedralSpeed, 0.1f) << "at the ends of the x and y axes";
  EXPECT_NEAR(above, 1, 0.01f);
  EXPECT_NEAR(below, 1, 0.01f);
}
// Shadow maps count on this: the speed does not grow much within an angle.
TEST(Octahedron, WithinAnAngleTheSpeedIsBounded) {
  Pcg32 random(3);
  float most = 0;
  for (int i = 0; i < 100000; ++i) {
    const Vec3 a = uniformSphere({random.next(), random.next()});
    const Vec3 b = normalize(a + uniformSphere({random.next(), random.next()}) * random.next());
    const float angle = std::acos(clamp(dot(a, b), -1, 1));
    most = std::max(most, octahedralSpeed(b) / std::min(octahedralSpeed(a) * (1 + 4 * angle), kOctahedralSpeed));
  }
  EXPECT_LT(most, 1.01f);
}

/// A closed room of 2 x 2 x 2 with two columns, a ball and a disk in it.
std::string room() {
  std::string s = R"(<shape type="cube"><boolean name="flip_normals" value="true"/></shape>)";
  for (const char* place : {"-0.4", "0.4"})
    s += fmt::format(
        R"(<shape type="cube"><transform name="to_world"><scale x="0.12" y="0.8" z="0.12"/><translate x="{}" y="-0.2"/>
    </transform></shape>)",
        place);
  return s +
         R"(<shape type="sphere"><point name="center" x="0.1" y="-0.6" z="0.6"/><float name="radius" value="0.25"/></shape>
    <shape type="disk"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="90"/>
      <translate x="-0.3" y="0.6" z="-0.6"/></transform></shape>)";
}
/// A ball on the ground, under the open sky.
std::string sky() {
  return R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/>
    <translate y="-1"/></transform></shape>
    <shape type="sphere"><point name="center" x="0" y="-0.3" z="0"/><float name="radius" value="0.4"/></shape>)";
}
SceneSnapshot sceneWith(const std::string& shapes) {
  return testing::sceneOf(shapes + testing::pinpointSensor("0, 0, 0.9", "0, 0, 0", "0, 1, 0", 4));
}

/// A place in the unit cube, half of them on the surface that lies in some direction from there.
LightVertex place(const Scene& scene, const EmbreeRays& rays, Pcg32& random) {
  for (;;) {
    LightVertex v;
    v.kind = VertexKind::medium;
    v.p = {1.98f * random.next() - 0.99f, 1.98f * random.next() - 0.99f, 1.98f * random.next() - 0.99f};
    const Ray ray{v.p, uniformSphere({random.next(), random.next()})};
    const RayHit hit = rays.nearest(ray, kInfinity);
    if (hit.found()) {
      const SurfacePoint s = surfacePoint(scene.view.surfaces[hit.shape], ray, hit, scene.view.scale);
      if (dot(s.geometricNormal, ray.d) > 0) continue;  // inside of something
      if (random.next() < 0.5f) v.kind = VertexKind::surface, v.p = s.p, v.normal = s.geometricNormal;
    }
    return v;
  }
}

/// Part of the connections between lights and places, weighted by the cosines at both, that maps judge wrongly.
struct Wrong {
  double dark = 0, bright = 0;
  double all() const { return dark + bright; }
};
/// `ask`: 1 asks the map of another light.
Wrong wrongPart(const Scene& scene, int points, int resolution, size_t ask = 0) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  Pcg32 random(7);
  std::vector<LightVertex> lights;
  for (int i = 0; i < 60; ++i) lights.push_back(place(scene, rays, random));
  const ShadowMapOptions options{.resolution = resolution, .seed = 5};
  const ShadowMaps maps = points > 0 ? ShadowMaps(SurfacePoints(scene.view, points, 3), lights, options)
                                     : ShadowMaps(*scene.surfaceRays, 1e-4f, lights, options);
  Wrong wrong;
  double all = 0;
  for (int i = 0; i < 60000; ++i) {
    const size_t l = random.nextBits() % lights.size();
    const LightVertex x = place(scene, rays, random);
    const LightVertex& v = lights[l];
    const Vec3 way = x.p - v.p;
    const float d = length(way), cosine = generalCosine(x.normal, way / d);
    if ((v.kind == VertexKind::surface && dot(v.normal, way) <= 0) ||
        (x.kind == VertexKind::surface && dot(x.normal, way) >= 0))
      continue;
    const double weight = double{cosine * generalCosine(v.normal, way / d)};
    const Vec3 from = v.p + v.normal * 1e-4f, to = x.p + x.normal * 1e-4f;
    const bool truth = !rays.occluded({from, normalize(to - from)}, distance(from, to));
    const bool seen = maps.view().visible((l + ask) % lights.size(), way, d, cosine);
    all += weight;
    (seen ? wrong.bright : wrong.dark) += seen != truth ? weight : 0;
  }
  return {wrong.dark / all, wrong.bright / all};
}

TEST(ShadowMaps, AgreeWithRays) {
  const SceneSnapshot closed = sceneWith(room()), open = sceneWith(sky());
  EXPECT_LT(wrongPart(*closed, 8000, 128).all(), 0.04);
  EXPECT_LT(wrongPart(*open, 8000, 128).all(), 0.015);
  EXPECT_GT(wrongPart(*closed, 8000, 128, 1).all(), 0.15) << "the test cannot fail";
  EXPECT_GT(wrongPart(*open, 8000, 128, 1).all(), 0.06) << "the test cannot fail";
}
TEST(ShadowMaps, ErrorsFallWithPointsAndTexels) {
  const SceneSnapshot scene = sceneWith(room());
  const double few = wrongPart(*scene, 500, 128).all(), some = wrongPart(*scene, 2000, 128).all(),
               many = wrongPart(*scene, 8000, 128).all();
  EXPECT_LT(some, 0.7 * few);
  EXPECT_LT(many, 0.8 * some);
  EXPECT_LT(many, 0.7 * wrongPart(*scene, 8000, 32).all());
}

TEST(ShadowMaps, ARayForEachTexelIsBetterThanPoints) {
  for (const std::string& shapes : {room(), sky()}) {
    const SceneSnapshot scene = sceneWith(shapes);
    const double coarse = wrongPart(*scene, 0, 32).all(), fine = wrongPart(*scene, 0, 128).all();
    EXPECT_LT(coarse, 0.8 * wrongPart(*scene, 2000, 32).all());
    EXPECT_LT(fine, 0.8 * wrongPart(*scene, 8000, 128).all());
    EXPECT_LT(fine, 0.6 * coarse);
  }
}

/// A light in a medium.
LightVertex lightAt(Vec3 p) {
  LightVertex v;
  v.kind = VertexKind::medium, v.p = p;
  return v;
}

TEST(ShadowMaps, DepthsAreDistances) {
  const SceneSnapshot cube = sceneWith(R"(<shape type="cube"/>)");
  const LightVertex light = lightAt({0.3f, -0.2f, 0.5f});
  const ShadowMaps maps(SurfacePoints(cube->view, 4000, 3), std::span(&light, 1), {});
  const EmbreeRays rays{*cube->surfaceRays, *cube->boundaryRays};
  Pcg32 random(4);
  stats::Moments ratio;
  int holes = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 w = uniformSphere({random.next(), random.next()});
    const float depth = maps.view().depth(0, w * 3.f);
    if (depth == kInfinity) {
      ++holes;
      continue;
    }
    const double r = double{depth / rays.nearest({light.p, w}, kInfinity).t};
    EXPECT_NEAR(r, 1, 0.4);  // at an edge, the one wall's texel may reach into the other
    ratio.add(r);
  }
  EXPECT_LT(holes, 20000 * 3e-3);
  EXPECT_NEAR(ratio.mean(), 1, 0.005);
  EXPECT_LT(ratio.variance(), 0.03 * 0.03);
}
TEST(ShadowMaps, OfABallAround) {
  const SceneSnapshot ball = sceneWith(R"(<shape type="sphere"><float name="radius" value="500"/></shape>)");
  const LightVertex light = lightAt({});
  const ShadowMaps maps(SurfacePoints(ball->view, 4000, 3), std::span(&light, 1), {.resolution = 64});
  Pcg32 random(4);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 w = uniformSphere({random.next(), random.next()});
    EXPECT_NEAR(maps.view().depth(0, w), 500, 500 * 0.004);
    EXPECT_TRUE(maps.view().visible(0, w, 480));
    EXPECT_FALSE(maps.view().visible(0, w, 540));
  }
}

TEST(ShadowMaps, DoNotDependOnTheNumberOfThreadsOrTheOtherLights) {
  const SceneSnapshot scene = sceneWith(room());
  const SurfacePoints points(scene->view, 1000, 3);
  std::vector<LightVertex> lights;
  for (int i = 0; i < 20; ++i) lights.push_back(lightAt({0.04f * static_cast<float>(i) - 0.5f, 0.8f, 0.2f}));
  const auto depths = [&](size_t threads, size_t count) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const ShadowMaps maps(points, std::span(lights).first(count), {.resolution = 32, .seed = 9});
    return std::vector<uint16_t>(maps.view().depths, maps.view().depths + count * 32 * 32);
  };
  const std::vector<uint16_t> one = depths(1, 20);
  EXPECT_EQ(one, depths(4, 20));
  const std::vector<uint16_t> few = depths(4, 5);
  EXPECT_TRUE(std::equal(few.begin(), few.end(), one.begin()));
}
TEST(ShadowMaps, ALightDrawsItsOwnPoints) {
  const SceneSnapshot scene = sceneWith(room());
  const SurfacePoints points(scene->view, 500, 3);
  const std::vector<LightVertex> lights(2, lightAt({0, 0.5f, 0}));
  ShadowMaps maps(points, lights, {.resolution = 32});
  const auto map = [&](size_t i) {
    return std::vector<uint16_t>(maps.view().depths + i * 1024, maps.view().depths + (i + 1) * 1024);
  };
  const std::vector<uint16_t> first = map(0), second = map(1);
  EXPECT_NE(first, second);
  maps.draw(points, lightAt({0.5f, 0.5f, 0}), 0);
  EXPECT_NE(map(0), first);
  EXPECT_EQ(map(1), second);
  maps.draw(points, lights[0], 0);
  EXPECT_EQ(map(0), first);
}

TEST(ShadowMaps, OfNothing) {
  const LightVertex light = lightAt({});
  for (const char* shapes :
       {"", R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"/></shape>)"}) {
    const SceneSnapshot scene = sceneWith(shapes);
    const ShadowMaps maps(SurfacePoints(scene->view, 1000, 3), std::span(&light, 1), {.resolution = 8});
    EXPECT_TRUE(maps.view().visible(0, {1, 2, 3}, 1e30f)) << shapes;
  }
  const SceneSnapshot scene = sceneWith(room());
  EXPECT_EQ(ShadowMaps(SurfacePoints(scene->view, 100, 3), {}, {}).count(), 0u);
}

TEST(SurfacePoints, CoverEachShape) {
  const SceneSnapshot scene = sceneWith(sky() + R"(<shape type="sphere"><float name="radius" value="1e-3"/></shape>)");
  const SurfacePoints points(scene->view, 1000, 3);
  double area = 0;
  int small = 0;
  for (int i = 0; i < points.cells(); ++i) {
    const SurfaceDisk& disk = points.disk(i, static_cast<uint32_t>(i));
    area += double{kPi * disk.radius * disk.radius};
    small += length(disk.p) < 0.0011f;
  }
  EXPECT_NEAR(points.cells(), 1000, 50);
  EXPECT_NEAR(small, 1000 / 6, 10);
  EXPECT_NEAR(area, double{SurfacePoints::kOverlap * (36 + 4 * kPi * 0.16f)}, 0.5);
}

}  // namespace
}  // namespace virga
