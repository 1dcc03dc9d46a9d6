// SPDX-License-Identifier: Apache-2.0
// Which media a ray passes. Every medium has a power of two as its coefficient, so that a sum tells which ones are
// there.
#include "transport/media_walk.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/warp.h"
#include "image/scratch.h"
#include "scene/scenes.h"

namespace virga {
namespace {

std::string medium(const std::string& side, int sigmaT) {
  return fmt::format("<medium name=\"{}\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"{}\"/></medium>", side,
                     sigmaT);
}

std::string volume(const std::string& shape, const std::string& content, const std::string& transform) {
  return fmt::format("<shape type=\"{}\"><bsdf type=\"null\"/><transform name=\"to_world\">{}</transform>{}</shape>\n",
                     shape, transform, content);
}

std::string placed(Vec3 at, Vec3 scale) {
  return fmt::format("<scale value=\"{}, {}, {}\"/><translate value=\"{}, {}, {}\"/>", scale.x, scale.y, scale.z, at.x,
                     at.y, at.z);
}

std::string boxVolume(const Bounds& b, int sigmaT) {
  return volume("cube", medium("interior", sigmaT), placed(b.center(), b.extent() * 0.5f));
}

/// A folder with meshes, gone at the end.
class Folder {
 public:
  std::string path() const { return folder_.path().string(); }
  /// All boxes in one mesh.
  void writeBoxes(const std::string& name, const std::vector<Bounds>& boxes) const {
    static constexpr int kTriangles[12][3] = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                                              {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
    std::ofstream file(folder_ / name);
    int first = 1;
    for (const Bounds& b : boxes) {
      for (int i = 0; i < 8; ++i) file << fmt::format("v {} {} {}\n", b.corner(i).x, b.corner(i).y, b.corner(i).z);
      for (const auto& t : kTriangles) file << fmt::format("f {} {} {}\n", first + t[0], first + t[1], first + t[2]);
      first += 8;
    }
  }

 private:
  ScratchFolder folder_;
};

std::string meshVolume(const std::string& file, int sigmaT, const std::string& transform = "") {
  return volume("obj", fmt::format("<string name=\"filename\" value=\"{}\"/>", file) + medium("interior", sigmaT),
                transform);
}

/// Sum of the coefficients of the media in a state.
int present(const SceneView& scene, const MediaState& state) {
  int sum = 0;
  for (int i = 0; i < state.count(); ++i) sum += static_cast<int>(scene.media[state.medium(i)].sigmaT);
  return sum;
}

struct Interval {
  float t0, t1;
  int media;
};

std::vector<Interval> intervals(const Scene& scene, MediaRay ray, float tMax = kInfinity) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  std::vector<Interval> found;
  float end = 0;
  walkMedia(scene.view, rays, ray, tMax, [&](float t0, float t1) {
    EXPECT_EQ(t0, end) << "a gap or an overlap";
    EXPECT_LT(t0, t1);
    end = t1;
    found.push_back({t0, t1, present(scene.view, ray.media)});
    return found.size() < 10'000;
  });
  EXPECT_EQ(end, tMax);
  return found;
}

MediaState stateAt(const Scene& scene, Vec3 p) { return mediaAt(scene, p); }

/// Checks all but the shortest intervals against what is known about points.
template <class Truth>
::testing::AssertionResult agrees(const Scene& scene, const MediaRay& ray, float tMax, const Truth& truth) {
  for (const Interval& i : intervals(scene, ray, tMax)) {
    if (i.t1 - i.t0 < 1e-4f) continue;
    const float t = std::isinf(i.t1) ? i.t0 + 100 : 0.5f * (i.t0 + i.t1);
    const Vec3 p = ray.ray.at(t);
    if (i.media != truth(p))
      return ::testing::AssertionFailure() << fmt::format("{} instead of {} at ({}, {}, {}), t {} in [{}, {}]", i.media,
                                                          truth(p), p.x, p.y, p.z, t, i.t0, i.t1);
  }
  return ::testing::AssertionSuccess();
}

bool contains(const Bounds& b, Vec3 p) {
  return p.x > b.lo.x && p.y > b.lo.y && p.z > b.lo.z && p.x < b.hi.x && p.y < b.hi.y && p.z < b.hi.z;
}

Vec3 inCube(Pcg32& random, float half) {
  const float x = random.next(), y = random.next(), z = random.next();
  return Vec3(2 * x - 1, 2 * y - 1, 2 * z - 1) * half;
}

Vec3 anyDirection(Pcg32& random) { return uniformSphere({random.next(), random.next()}); }

TEST(WalkMedia, OverlappingVolumesAdd) {
  const Folder folder;
  const Bounds a{Vec3(-2, -1, -1), Vec3(0.5f, 1, 1)}, b{Vec3(0, -0.7f, -2), Vec3(2, 1.5f, 2)}, c{Vec3(-1), Vec3(1)};
  folder.writeBoxes("c.obj", {c});
  for (const bool many : {false, true}) {  // few analytic boundaries are asked one by one, more through a traversal
    const SceneSnapshot scene =
        test::build(boxVolume(a, 1) + boxVolume(b, 2) + (many ? meshVolume("c.obj", 4) : "") +
                        volume("sphere", medium("interior", 8), placed(Vec3(-1, 0, 0), Vec3(1.2f))),
                    folder.path());
    const auto truth = [&](Vec3 p) {
      return (contains(a, p) ? 1 : 0) + (contains(b, p) ? 2 : 0) + (many && contains(c, p) ? 4 : 0) +
             (distance(p, {-1, 0, 0}) < 1.2f ? 8 : 0);
    };
    Pcg32 random(1);
    for (int i = 0; i < 20'000; ++i) {
      const Vec3 o = inCube(random, 4);
      const MediaState state = stateAt(*scene, o);
      ASSERT_EQ(present(scene->view, state), truth(o));
      const float tMax = i % 3 == 0 ? 3 * random.next() : kInfinity;
      ASSERT_TRUE(agrees(*scene, {{o, anyDirection(random)}, state, 0}, tMax, truth));
    }
  }
}

TEST(WalkMedia, TouchingVolumesLeaveNoGap) {
  const Bounds left{Vec3(-1), Vec3(0.1f, 1, 1)}, right{Vec3(0.1f, -1, -1), Vec3(1)};
  const SceneSnapshot scene = test::build(boxVolume(left, 1) + boxVolume(right, 2));
  Pcg32 random(2);
  for (int i = 0; i < 10'000; ++i) {
    const Vec3 from = inCube(random, 0.99f), to = inCube(random, 0.99f);
    if (std::fabs(from.x - 0.1f) < 1e-3f || std::fabs(from.x - to.x) < 1e-3f) continue;
    ASSERT_TRUE(agrees(*scene, {{from, normalize(to - from)}, stateAt(*scene, from), 0}, distance(from, to),
                       [](Vec3 p) { return p.x < 0.1f ? 1 : 2; }));
  }
}

TEST(WalkMedia, ADeclaredExteriorReplaces) {
  const std::string inner =
      volume("sphere", medium("interior", 2) + medium("exterior", 1), placed(Vec3(0.2f), Vec3(0.5f)));
  const SceneSnapshot scene = test::build(boxVolume({Vec3(-1), Vec3(1)}, 1) + inner);
  const auto truth = [](Vec3 p) {
    if (distance(p, Vec3(0.2f)) < 0.5f) return 2;
    return contains({Vec3(-1), Vec3(1)}, p) ? 1 : 0;
  };
  Pcg32 random(3);
  for (int i = 0; i < 10'000; ++i) {
    const Vec3 o = i % 2 == 0 ? anyDirection(random) * 3.f : inCube(random, 0.98f);
    const MediaState state = i % 2 == 0 ? MediaState() : stateAt(*scene, o);
    ASSERT_EQ(present(scene->view, state), truth(o));
    ASSERT_TRUE(agrees(*scene, {{o, anyDirection(random)}, state, 0}, kInfinity, truth));
  }
}

TEST(WalkMedia, MoreCrossingsThanOneListHolds) {
  const Folder folder;
  std::vector<Bounds> slices;
  for (int i = 0; i < 100; ++i)
    slices.push_back({Vec3(static_cast<float>(i), -1, -1), Vec3(static_cast<float>(i) + 0.5f, 1, 1)});
  folder.writeBoxes("slices.obj", slices);
  const SceneSnapshot scene = test::build(meshVolume("slices.obj", 1), folder.path());
  const auto truth = [](Vec3 p) {
    const bool inside =
        std::fabs(p.y) < 1 && std::fabs(p.z) < 1 && p.x > 0 && p.x < 99.5f && p.x - std::floor(p.x) < 0.5f;
    return inside ? 1 : 0;
  };
  Pcg32 random(4);
  for (int i = 0; i < 300; ++i) {
    const float y = 1.6f * random.next() - 0.8f, z = 1.6f * random.next() - 0.8f;
    const Vec3 d = normalize(Vec3(100, random.next() - 0.5f, random.next() - 0.5f) * (i % 2 == 0 ? 1.f : -1.f));
    const Vec3 o(i % 2 == 0 ? -5.f : 105.f, y, z);
    ASSERT_TRUE(agrees(*scene, {{o, d}, {}, 0}, kInfinity, truth));
  }
  EXPECT_GT(intervals(*scene, {{{-5, 0.1f, 0.2f}, {1, 0, 0}}, {}, 0}).size(), 199);
}

// One volume ends where the next begins: the list of crossings may be cut between the two at the same distance.
TEST(WalkMedia, ManyTouchingVolumes) {
  for (const int shift : {0, 1}) {
    std::string elements;
    for (int i = 0; i < 60; ++i) {
      const auto x = static_cast<float>(i);
      elements += boxVolume({Vec3(x, -1, -1), Vec3(x + 1, 1, 1)}, 1 + i % 2);
    }
    // Moves the place where the first list ends by one crossing.
    if (shift) elements += boxVolume({Vec3(-3, -1, -1), Vec3(3.5f, 1, 1)}, 4);
    const SceneSnapshot scene = test::build(elements);
    const auto truth = [&](Vec3 p) {
      if (std::fabs(p.y) > 1 || std::fabs(p.z) > 1) return 0;
      const int striped = p.x > 0 && p.x < 60 ? 1 + static_cast<int>(p.x) % 2 : 0;
      return striped + (shift && p.x > -3 && p.x < 3.5f ? 4 : 0);
    };
    Pcg32 random(5);
    for (int i = 0; i < 200; ++i) {
      const float y = 1.2f * random.next() - 0.6f, z = 1.2f * random.next() - 0.6f;
      const float slope = i % 4 < 2 ? 0 : 0.01f * random.next();
      const Vec3 d = normalize(Vec3(1, slope, -slope) * (i % 2 == 0 ? 1.f : -1.f));
      ASSERT_TRUE(agrees(*scene, {{{i % 2 == 0 ? -5.25f : 65.3f, y, z}, d}, {}, 0}, kInfinity, truth));
    }
  }
}

// Rays at corners and at points of edges, diagonals of faces among them: met by several triangles, or seen from the
// side.
TEST(WalkMedia, EdgesAndCornersOfAMesh) {
  const Folder folder;
  const Bounds box{Vec3(-1), Vec3(1)};
  folder.writeBoxes("box.obj", {box});
  const SceneSnapshot scene = test::build(meshVolume("box.obj", 1), folder.path());
  Pcg32 random(6);
  for (int i = 0; i < 200'000; ++i) {
    const Vec3 a = box.corner(static_cast<int>(8 * random.next())), b = box.corner(static_cast<int>(8 * random.next()));
    const Vec3 target = i % 3 == 0 ? a : a + (b - a) * (i % 3 == 1 ? 0.5f : random.next());
    const bool inside = i % 2 == 0;
    // On a coarse lattice half of the time, so that many rays lie in planes of the mesh.
    Vec3 o = inside ? inCube(random, 0.95f) : anyDirection(random) * 4.f;
    if (i % 5 < 3)
      for (int k = 0; k < 3; ++k) o[k] = std::round(o[k] * 4) / 4;
    if (inside ? !contains(box, o) : contains({Vec3(-1.01f), Vec3(1.01f)}, o)) continue;
    if (distance(o, target) < 1e-3f) continue;
    const Ray ray{o, normalize(target - o)};
    MediaState state;
    if (inside) state.enter(0, scene->view.boundaries[0].interior);
    const std::vector<Interval> found = intervals(*scene, {ray, state, 0});
    ASSERT_EQ(found.back().media, 0) << fmt::format("({}, {}, {}) toward ({}, {}, {}): never leaves", o.x, o.y, o.z,
                                                    target.x, target.y, target.z);
    for (const Interval& part : found) {
      if (part.t1 - part.t0 < 1e-4f || std::isinf(part.t1)) continue;
      const Vec3 p = ray.at(0.5f * (part.t0 + part.t1));
      // A ray within a face may count as inside or outside.
      const float depth = 1 - maxComponent(abs(p));
      ASSERT_TRUE(std::fabs(depth) <= 1e-5f || part.media == (depth > 0 ? 1 : 0)) << depth;
    }
  }
}

// Two boxes of one mesh with an edge in common, and a ray inside one of them that touches it: it stays inside.
TEST(WalkMedia, AConcaveEdgeThatIsTouchedFromWithin) {
  const Folder folder;
  // An L: what is missing is the quadrant x > 0, y > 0.
  std::ofstream file(std::filesystem::path(folder.path()) / "l.obj");
  const float outline[6][2] = {{-2, -2}, {2, -2}, {2, 0}, {0, 0}, {0, 2}, {-2, 2}};
  for (const float z : {-2.f, 2.f})
    for (const auto& p : outline) file << fmt::format("v {} {} {}\n", p[0], p[1], z);
  for (int i = 0; i < 6; ++i) {
    const int j = (i + 1) % 6;
    file << fmt::format("f {} {} {}\nf {} {} {}\n", i + 1, j + 1, j + 7, i + 1, j + 7, i + 7);
  }
  for (const auto& t : {std::array{1, 2, 4}, {2, 3, 4}, {1, 4, 6}, {4, 5, 6}})
    file << fmt::format("f {} {} {}\nf {} {} {}\n", t[2], t[1], t[0], t[0] + 6, t[1] + 6, t[2] + 6);
  file.close();
  const SceneSnapshot scene = test::build(meshVolume("l.obj", 1), folder.path());
  Pcg32 random(7);
  for (int i = 0; i < 20'000; ++i) {
    const float slope = 0.1f + 3 * random.next(), z = 3 * random.next() - 1.5f;
    const Vec3 touch(0, 0, z), d = normalize(Vec3(1, -slope, 0.2f * (random.next() - 0.5f)));
    const float back = 0.3f + random.next();
    const Vec3 o = i % 2 == 0 ? touch - d * back : touch - normalize(Vec3(1, -1, 0)) * back;
    MediaState state;
    state.enter(0, scene->view.boundaries[0].interior);
    if (!contains({Vec3(-2), Vec3(2)}, o) || (o.x >= 0 && o.y >= 0)) continue;
    for (const Interval& part : intervals(*scene, {{o, normalize(touch - o)}, state, 0})) {
      if (part.t1 - part.t0 < 1e-4f) continue;
      const float t = std::isinf(part.t1) ? part.t0 + 10 : 0.5f * (part.t0 + part.t1);
      const Vec3 p = o + normalize(touch - o) * t;
      const bool inside = contains({Vec3(-2), Vec3(2)}, p) && !(p.x > 0 && p.y > 0);
      ASSERT_TRUE(p.x * p.y >= -1e-6f || part.media == (inside ? 1 : 0)) << fmt::format("({}, {}, {})", p.x, p.y, p.z);
    }
  }
}

TEST(WalkMedia, AVolumeThatStandsOnTheGround) {
  const Folder folder;
  for (const bool mesh : {false, true}) {
    const Bounds box{Vec3(-1, -1, 0.3f), Vec3(1, 1, 2.3f)};
    folder.writeBoxes("box.obj", {box});
    const SceneSnapshot scene = test::build((mesh ? meshVolume("box.obj", 1) : boxVolume(box, 1)) +
                                                "<shape type=\"rectangle\"><transform name=\"to_world\">" +
                                                placed(Vec3(0, 0, 0.3f), Vec3(5)) + "</transform></shape>",
                                            folder.path());
    const auto truth = [&](Vec3 p) { return contains(box, p) ? 1 : 0; };
    Pcg32 random(8);
    for (int i = 0; i < 50'000; ++i) {
      const Vec3 target(4 * random.next() - 2, 4 * random.next() - 2, 0.3f);
      // Also along the ground.
      const float height = i % 2 == 0 ? random.next() : std::pow(10.f, -3 * random.next());
      const float phi = kTwoPi * random.next();
      const Vec3 w = sphericalDirection(std::sqrt(1 - height * height), height, phi);
      const Vec3 from =
          target + sphericalDirection(std::sqrt(1 - height * height), height, kTwoPi * random.next()) * 3.f;
      if (from.z < 0.31f) continue;
      MediaRay arriving{{from, normalize(target - from)}, stateAt(*scene, from), 0};
      const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
      const RayHit hit = rays.nearest(arriving.ray, kInfinity);
      ASSERT_TRUE(hit.found());
      const SurfacePoint point = surfacePoint(scene->view.surfaces[hit.shape], arriving.ray, hit, scene->view.scale);
      walkMedia(scene->view, rays, arriving, hit.t, [](float, float) { return true; });
      ASSERT_TRUE(agrees(*scene, leaveSurface(point, w, arriving.media), kInfinity, truth));
      ASSERT_TRUE(agrees(*scene, leaveSurface(point, -w, arriving.media), kInfinity, truth));
    }
  }
}

TEST(WalkMedia, StopsWhenTold) {
  const SceneSnapshot scene =
      test::build(boxVolume({Vec3(-1), Vec3(1)}, 1) + boxVolume({Vec3(2, -1, -1), Vec3(3, 1, 1)}, 2));
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  MediaRay ray{{{-5, 0, 0}, {1, 0, 0}}, {}, 0};
  int visited = 0;
  walkMedia(scene->view, rays, ray, kInfinity, [&](float, float) { return ++visited < 2; });
  EXPECT_EQ(visited, 2);
  EXPECT_EQ(present(scene->view, ray.media), 1) << "the state is that of the interval where the walk ended";
}

TEST(Collisions, OfOverlappingVolumesAddUp) {
  const SceneSnapshot scene = test::build(boxVolume({Vec3(-1), Vec3(1)}, 1) + boxVolume({Vec3(-1), Vec3(1)}, 4));
  MediaRay ray{{{0, 0, 0}, {0, 0, 1}}, stateAt(*scene, {}), 0};
  ASSERT_EQ(present(scene->view, ray.media), 5);
  Pcg32 random(9);
  int count[2] = {0, 0};
  double sum = 0;
  constexpr int kCount = 100'000;
  for (int i = 0; i < kCount; ++i) {
    const Collision c = sampleCollision(scene->view, ray, 0, kInfinity, random);
    ++count[scene->view.media[c.medium].sigmaT > 2 ? 1 : 0];
    sum += static_cast<double>(c.t);
  }
  EXPECT_NEAR(sum / kCount, 0.2, 4 * 0.2 / std::sqrt(kCount));
  EXPECT_NEAR(count[1] / double{kCount}, 0.8, 4 * 0.4 / std::sqrt(kCount));
}

Rgb transmittance(const SceneView& scene, const EmbreeRays& rays, MediaRay ray, float tMax, Pcg32& random) {
  return passMedia(scene, rays, ray, tMax, random);
}

TEST(Collisions, TransmittanceIsTheProductOverAllIntervals) {
  const SceneSnapshot scene =
      test::build(boxVolume({Vec3(-1), Vec3(1)}, 1) + boxVolume({Vec3(0, -1, -1), Vec3(3, 1, 1)}, 2));
  const EmbreeRays rays{*scene->surfaceRays, *scene->boundaryRays};
  Pcg32 random(10);
  const MediaRay ray{{{-1.5f, 0.1f, 0.2f}, {1, 0, 0}}, {}, 0};
  EXPECT_NEAR(transmittance(scene->view, rays, ray, 2.f, random).g, std::exp(-(1.5f + 2 * 0.5f)), 1e-6);
  EXPECT_NEAR(transmittance(scene->view, rays, ray, kInfinity, random).g, std::exp(-(2.f + 2 * 3)), 1e-6);
  EXPECT_EQ(transmittance(scene->view, rays, {{{-1.5f, 0, 0}, {-1, 0, 0}}, {}, 0}, kInfinity, random), Rgb(1.f));
}

}  // namespace
}  // namespace virga
