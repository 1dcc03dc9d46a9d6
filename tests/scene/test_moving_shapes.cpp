// SPDX-License-Identifier: Apache-2.0
// Frames of a sequence: what changed is known, the rest is shared, and rays find what they would find in a scene that
// was built from scratch.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/random.h"
#include "loaders/mitsuba_xml.h"
#include "scene/builder.h"
#include "scene/scene_parts.h"

namespace virga {
namespace {

constexpr const char* kScene = R"(<scene version="3.0.0">
  <sensor type="perspective" id="camera"><animation name="to_world">
    <transform time="4"><lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/></transform>
    <transform time="5"><lookat origin="1, 0, 9" target="0, 0, 0" up="0, 1, 0"/></transform></animation></sensor>
  <emitter type="point" id="lamp"><rgb name="intensity" value="30"/><animation name="to_world">
    <transform time="5"><translate y="3"/></transform><transform time="6"><translate y="4"/></transform></animation></emitter>
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="5"/><rotate x="1" angle="-90"/>
    <translate y="-1"/></transform></shape>
  <shape type="cube" id="block"><animation name="to_world"><transform time="1"><scale value="0.4"/></transform>
    <transform time="3"><scale value="0.4"/><rotate x="1" y="1" angle="80"/><translate x="1"/></transform></animation></shape>
  <shape type="sphere" id="ball"><float name="radius" value="0.5"/><animation name="to_world">
    <transform time="2"><translate x="-1"/></transform><transform time="4"><translate x="1"/></transform></animation></shape>
  <shape type="rectangle" id="wall"><transform name="to_world"><scale value="5"/><translate z="-2"/></transform></shape>
  <shape type="sphere" id="cloud"><bsdf type="null"/><animation name="to_world"><transform time="3"/>
    <transform time="4"><translate y="1"/></transform></animation>
    <medium name="interior" type="homogeneous" id="fog"><float name="sigma_t" value="0.5"/></medium></shape>
  <shape type="cube" id="room"><bsdf type="null"/><transform name="to_world"><scale value="3"/></transform>
    <medium name="interior" type="homogeneous"><float name="sigma_t" value="0.1"/></medium></shape>
</scene>)";

SceneDescription frameOf(int frame, const char* text = kScene) {
  return parseMitsubaXml(text, "frames.xml", ".", {.defines = {{"frame", std::to_string(frame)}}});
}

std::vector<Change> changesTo(int frame, const char* text = kScene) {
  return differences(frameOf(frame - 1, text), frameOf(frame, text)).changes;
}

TEST(MovingShapes, ChangesFromFrameToFrameAreJustThose) {
  using Changes = std::vector<Change>;
  EXPECT_EQ(changesTo(1), Changes{});
  EXPECT_EQ(changesTo(2), (Changes{{"block", Aspect::shapePose}}));
  EXPECT_EQ(changesTo(3), (Changes{{"ball", Aspect::shapePose}, {"block", Aspect::shapePose}}));
  EXPECT_EQ(changesTo(4), (Changes{{"ball", Aspect::shapePose}, {"cloud", Aspect::shapePose}}));
  EXPECT_EQ(changesTo(5), (Changes{{"camera", Aspect::camera}}));
  EXPECT_EQ(changesTo(6), (Changes{{"lamp", Aspect::emitterPose}}));
  constexpr const char* kSmoke = R"(<scene version="3.0.0"><default name="frame" value="1"/><sensor type="perspective"/>
    <shape type="cube"><bsdf type="null"/><medium name="interior" type="heterogeneous"><float name="scale" value="3"/>
    <volume name="sigma_t" type="gridvolume" id="smoke"><string name="filename" value="smoke.$frame.vol"/></volume>
    </medium></shape></scene>)";
  EXPECT_EQ(changesTo(4, kSmoke), (Changes{{"smoke", Aspect::mediumGrid}}));
}

bool same(const RayHit& a, const RayHit& b) {
  return a.t == b.t && a.shape == b.shape && a.primitive == b.primitive && a.u == b.u && a.v == b.v;
}

// Returns how many of the rays met something.
int expectSameQueries(const RayScene& a, const RayScene& b, uint64_t seed) {
  Pcg32 random(seed);
  const auto number = [&] { return 4 * random.next() - 2; };
  int hits = 0;
  for (int i = 0; i < 4000; ++i) {
    const Ray ray{Vec3(number(), number(), number()), normalize(Vec3(number(), number(), number()))};
    const RayHit hit = a.nearest(ray, 0, kInfinity);
    EXPECT_TRUE(same(hit, b.nearest(ray, 0, kInfinity)));
    const float end = 3 * random.next();
    EXPECT_EQ(a.occluded(ray, 0, end), b.occluded(ray, 0, end));
    CrossingList x, y;
    a.crossings(ray, 0, kInfinity, x);
    b.crossings(ray, 0, kInfinity, y);
    EXPECT_EQ(x.count, y.count);
    for (int k = 0; k < std::min(x.count, y.count); ++k)
      EXPECT_TRUE(x.items[k].t == y.items[k].t && x.items[k].shape == y.items[k].shape &&
                  x.items[k].entering == y.items[k].entering);
    hits += hit.found() ? 1 : 0;
  }
  return hits;
}

TEST(MovingShapes, RaysFindWhatTheyFindInAFreshScene) {
  SceneSnapshot scene = buildScene(frameOf(1));
  EXPECT_EQ(scene->surfaceRays->movedShapes(), 0);
  const int moved[] = {0, 1, 2, 2, 2, 2};
  for (int frame = 1; frame <= 6; ++frame) {
    scene = buildScene(frameOf(frame), {}, scene);
    const SceneSnapshot fresh = buildScene(frameOf(frame));
    EXPECT_EQ(scene->surfaceRays->movedShapes(), moved[frame - 1]) << frame;
    EXPECT_EQ(fresh->surfaceRays->movedShapes(), 0);
    EXPECT_GT(expectSameQueries(*scene->surfaceRays, *fresh->surfaceRays, static_cast<uint64_t>(frame)), 500);
    expectSameQueries(*scene->boundaryRays, *fresh->boundaryRays, static_cast<uint64_t>(frame));
  }
}

// Meshes and more than a few boundaries go through traversals; here the boundaries move, too.
TEST(MovingShapes, BoundariesOfMeshesMoveAsWell) {
  std::string text = R"(<scene version="3.0.0"><sensor type="perspective"/>)";
  for (int i = 0; i < 6; ++i)
    text += fmt::format(R"(<shape type="cube"><bsdf type="null"/><boolean name="flip_normals" value="{}"/>
      <animation name="to_world"><transform time="{}"><scale value="0.{}"/></transform><transform time="{}"><scale value="0.{}"/>
      <rotate y="1" angle="50"/><translate x="0.7"/></transform></animation>
      <medium name="interior" type="homogeneous"><float name="sigma_t" value="0.{}"/></medium></shape>)",
                        i % 2 == 0, i, 3 + i, i + 1, 3 + i, 1 + i);
  text += "</scene>";
  SceneSnapshot scene = buildScene(frameOf(0, text.c_str()));
  for (int frame = 1; frame <= 4; ++frame) {
    scene = buildScene(frameOf(frame, text.c_str()), {}, scene);
    EXPECT_GE(scene->boundaryRays->movedShapes(), frame);
    const SceneSnapshot fresh = buildScene(frameOf(frame, text.c_str()));
    expectSameQueries(*scene->boundaryRays, *fresh->boundaryRays, static_cast<uint64_t>(frame));
  }
}

TEST(MovingShapes, WhatStandsIsShared) {
  const SceneSnapshot first = buildScene(frameOf(1)), second = buildScene(frameOf(2), {}, first),
                      third = buildScene(frameOf(3), {}, second), fourth = buildScene(frameOf(4), {}, third),
                      fifth = buildScene(frameOf(5), {}, fourth);
  EXPECT_FALSE(second->surfaceRays->sharesStandingShapes(*first->surfaceRays));
  EXPECT_FALSE(third->surfaceRays->sharesStandingShapes(*second->surfaceRays)) << "the ball has begun to move";
  EXPECT_TRUE(fourth->surfaceRays->sharesStandingShapes(*third->surfaceRays));
  EXPECT_EQ(fifth->surfaceRays, fourth->surfaceRays) << "the camera alone moved";
  EXPECT_EQ(second->boundaryRays, first->boundaryRays);
  EXPECT_EQ(fourth->parts->surfaceShapes[0], first->parts->surfaceShapes[0]);
  EXPECT_NE(fourth->parts->surfaceShapes[2], third->parts->surfaceShapes[2]);
}

TEST(MovingShapes, ShapesComeGoAndAreThereTwice) {
  const auto sceneOf = [](const std::string& shapes, const SceneSnapshot& previous) {
    const std::string text = "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>" + shapes + "</scene>";
    return buildScene(parseMitsubaXml(text, "shapes.xml", "."), {}, previous);
  };
  const auto ball = [](double x) {
    return fmt::format(R"(<shape type="sphere"><point name="center" x="{}" y="0" z="0"/></shape>)", x);
  };
  SceneSnapshot scene = sceneOf(ball(0) + ball(1) + ball(0), nullptr);
  for (const std::string& shapes : {ball(1) + ball(0) + ball(0), ball(-1) + ball(0) + ball(1) + ball(0), ball(1),
                                    ball(3) + ball(-1), std::string(), ball(1) + ball(2)}) {
    scene = sceneOf(shapes, scene);
    const SceneSnapshot fresh = sceneOf(shapes, nullptr);
    Pcg32 random(1);
    for (int i = 0; i < 500; ++i) {
      // From outside all balls: where two are the same, either may be the one that is met.
      const Ray ray{Vec3(6 * random.next() - 3, 5, 0), {0, -1, 0.1f * random.next()}};
      const RayHit a = scene->surfaceRays->nearest(ray, 0, kInfinity),
                   b = fresh->surfaceRays->nearest(ray, 0, kInfinity);
      ASSERT_EQ(a.t, b.t);
      if (!a.found()) continue;
      ASSERT_EQ(scene->view.surfaces[a.shape].center, fresh->view.surfaces[b.shape].center);
    }
  }
}

}  // namespace
}  // namespace virga
