// SPDX-License-Identifier: Apache-2.0
// The boxes around a scene's media hold all of them, however small they are, and little else.
#include "transport/media_bounds.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/random.h"
#include "image/scratch.h"
#include "scene/scenes.h"
#include "transport/virtual_lights.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

class MediaBoundsTest : public ::testing::Test {
 protected:
  MediaBoundsTest() {
    constexpr int kSize = 16;
    DenseVolume volume{kSize, kSize, kSize, {}, {}};
    for (int i = 0; i < kSize * kSize * kSize; ++i) volume.values.push_back(i % kSize < kSize / 2 ? 1.f : 0.f);
    writeVol(folder_ / "half.vol", volume);
  }

  SceneSnapshot build(const std::string& elements, const std::string& inSensor = "") const {
    return buildScene(
        test::describe(elements + R"(<sensor type="perspective">)" + inSensor + "</sensor>", folder_.path().string()));
  }

 private:
  ScratchFolder folder_;
};

/// A cube of smoke, filled where x is below its middle.
std::string smoke(const std::string& name, const std::string& center, double size) {
  return fmt::format(R"(<medium type="heterogeneous" id="{}"><volume name="sigma_t" type="gridvolume">
      <string name="filename" value="half.vol"/><transform name="to_world"><translate value="-0.5"/>
      <scale value="{}"/><translate {}/></transform></volume></medium>)",
                     name, size, center);
}
std::string cube(const std::string& center, double size, const std::string& media) {
  return fmt::format(R"(<shape type="cube"><transform name="to_world"><scale value="{}"/><translate {}/></transform>
      <bsdf type="null"/>{}</shape>)",
                     size / 2, center, media);
}
std::string interior(const std::string& medium) { return fmt::format(R"(<ref id="{}" name="interior"/>)", medium); }

const std::string kFloor = R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
    <translate y="-2"/></transform></shape>)";

void expectNear(const Bounds& found, const Bounds& wanted) {
  EXPECT_LT(length(found.lo - wanted.lo), 1e-4f) << found.lo.x << ' ' << found.lo.y << ' ' << found.lo.z;
  EXPECT_LT(length(found.hi - wanted.hi), 1e-4f) << found.hi.x << ' ' << found.hi.y << ' ' << found.hi.z;
}

TEST_F(MediaBoundsTest, SmallGridsFarApart) {
  const std::string here = R"(x="3" y="1" z="0")", there = R"(x="-90" y="0" z="70")";
  const SceneSnapshot scene = build(smoke("a", here, 0.5) + cube(here, 0.4, interior("a")) + smoke("b", there, 0.2) +
                                    cube(there, 2, interior("b")) + kFloor);
  ASSERT_EQ(scene->view.media.size, 2);
  const Bounds near{Vec3(2.8f, 0.8f, -0.2f), Vec3(3.03125f, 1.2f, 0.2f)};  // a voxel's width past the middle
  ASSERT_EQ(placesOf(*scene, 0).size(), 1u);
  const Bounds found = placesOf(*scene, 0)[0];
  EXPECT_LE(found.hi.x, 3.2f);
  EXPECT_GE(found.hi.x, near.hi.x - 0.032f);
  EXPECT_LT(length(found.lo - near.lo), 1e-4f);
  const Bounds all = boundsOfMedia(*scene);
  EXPECT_LE(all.lo.x, -90.1f + 1e-4f);
  EXPECT_GE(all.hi.x, 3);
  EXPECT_GE(all.hi.z, 70.1f - 1e-4f);
}

TEST_F(MediaBoundsTest, AGridAroundTheCameraWithoutAnyShape) {
  const SceneSnapshot scene = build(smoke("a", R"(x="100")", 4), R"(<ref id="a" name="medium"/>)");
  const Bounds found = boundsOfMedia(*scene);
  EXPECT_LT(length(found.lo - Vec3(98, -2, -2)), 1e-3f);
  EXPECT_GE(found.hi.x, 100);
  EXPECT_LE(found.hi.x, 102.001f);
  EXPECT_LT(std::fabs(found.hi.y - 2), 1e-3f);
}

TEST_F(MediaBoundsTest, FogInAShapeAndAroundEverything) {
  const std::string fog = R"(<medium type="homogeneous" id="f"/>)", center = R"(x="9" y="0" z="0")";
  const Bounds bounded{Vec3(8, -1, -1), Vec3(10, 1, 1)};
  expectNear(boundsOfMedia(*build(fog + cube(center, 2, interior("f")) + kFloor)), bounded);
  // A ball whose outside is that fog again, and which lies in it, is nothing new.
  const std::string ball = R"(<shape type="sphere"><point name="center" x="9" y="0.2" z="0"/>
      <float name="radius" value="0.3"/><bsdf type="dielectric"/><ref id="f" name="exterior"/></shape>)";
  expectNear(boundsOfMedia(*build(fog + cube(center, 2, interior("f")) + ball + kFloor)), bounded);
  // Elsewhere its outside has no end.
  const Bounds around = boundsOfMedia(*build(fog + ball + kFloor));
  const Bounds endless = boundsOfMedia(*build(fog + kFloor, R"(<ref id="f" name="medium"/>)"));
  for (const Bounds& b : {around, endless}) {
    EXPECT_LT(b.lo.x, -3);
    EXPECT_GT(b.hi.y, 3);
  }
}

TEST_F(MediaBoundsTest, BoxesAreSharedByWhatLiesTogether) {
  const auto boxes = [&](double x, double size, size_t most) {
    const std::string fog = R"(<medium type="homogeneous" id="f"/>)", center = fmt::format(R"(x="{}" y="0" z="0")", x);
    return boxesOfMedia(
        *build(fog + cube(R"(x="0" y="0" z="0")", 2, interior("f")) + cube(center, size, interior("f")) + kFloor),
        most);
  };
  EXPECT_EQ(boxes(2.1, 2, 8).size(), 1u);
  ASSERT_EQ(boxes(9, 2, 8).size(), 2u);
  EXPECT_FALSE(overlap(boxes(9, 2, 8)[0], boxes(9, 2, 8)[1]));
  EXPECT_EQ(boxes(1.3, 0.1, 8).size(), 2u) << "small beside large";
  EXPECT_EQ(boxes(9, 2, 1).size(), 1u);
  expectNear(boxes(9, 2, 1)[0], {Vec3(-1), Vec3(10, 1, 1)});
}

TEST_F(MediaBoundsTest, NoMedia) { EXPECT_TRUE(boundsOfMedia(*build(kFloor)).empty()); }

// Points that lie in a medium, by asking for the media at each.
TEST_F(MediaBoundsTest, HoldEveryPointThatIsInAMedium) {
  const std::string turned = R"(<shape type="cube"><transform name="to_world"><rotate x="1" y="1" angle="30"/>
      <scale value="0.6"/><translate x="2"/></transform><bsdf type="null"/><ref id="a" name="interior"/></shape>)";
  const std::string pocket = R"(<shape type="sphere"><point name="center" x="-2" y="0.5" z="0"/>
      <float name="radius" value="0.7"/><bsdf type="dielectric"/><ref id="f" name="interior"/></shape>)";
  const SceneSnapshot scene =
      build(smoke("a", R"(x="2")", 1.5) + R"(<medium type="homogeneous" id="f"/>)" + turned + pocket + kFloor);
  const Bounds bounds = boundsOfMedia(*scene);
  Pcg32 random(3);
  int within = 0;
  for (int n = 0; n < 20000; ++n) {
    const Vec3 p = Vec3(random.next(), random.next(), random.next()) * 8 - Vec3(4);
    const MediaState media = mediaAt(*scene, p);
    for (int i = 0; i < media.count(); ++i) {
      if (isBlack(scene->view.media[media.medium(i)].sigmaTAt(p))) continue;
      ++within;
      EXPECT_TRUE(p.x >= bounds.lo.x && p.y >= bounds.lo.y && p.z >= bounds.lo.z && p.x <= bounds.hi.x &&
                  p.y <= bounds.hi.y && p.z <= bounds.hi.z);
    }
  }
  EXPECT_GT(within, 50);
  EXPECT_LT(bounds.hi.x - bounds.lo.x, 6.5f);
}

}  // namespace
}  // namespace virga
