// SPDX-License-Identifier: Apache-2.0
#include "core/keyframes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace virga {
namespace {

void expectNear(const Matrix4& a, const Matrix4& b, double tolerance = 1e-12) {
  for (size_t i = 0; i < 16; ++i) EXPECT_NEAR(a.m[i], b.m[i], tolerance) << i;
}

const Matrix4 kStart = Matrix4::translation(1, 2, 3) * Matrix4::rotation(1, 1, 0, 20) * Matrix4::scaling(1, 2, 4);
const Matrix4 kEnd = Matrix4::translation(3, 2, -1) * Matrix4::rotation(1, 1, 0, 140) * Matrix4::scaling(3, 2, 8);

TEST(Keyframes, EachPartGoesFromOneToTheOther) {
  const std::vector<Keyframe> keys{{10, kStart}, {20, kEnd}};
  expectNear(poseAt(keys, 12.5),
             Matrix4::translation(1.5, 2, 2) * Matrix4::rotation(1, 1, 0, 50) * Matrix4::scaling(1.5, 2, 5));
  expectNear(poseAt(keys, 15),
             Matrix4::translation(2, 2, 1) * Matrix4::rotation(1, 1, 0, 80) * Matrix4::scaling(2, 2, 6));
}

TEST(Keyframes, AreHitExactlyAndHoldOutside) {
  const std::vector<Keyframe> keys{{0, kStart}, {4, kStart}, {6, kEnd}};
  for (const double time : {-5.0, 0.0, 1.7, 4.0}) EXPECT_EQ(poseAt(keys, time), kStart) << time;
  for (const double time : {6.0, 1e9}) EXPECT_EQ(poseAt(keys, time), kEnd) << time;
  EXPECT_EQ(poseAt(std::vector<Keyframe>{{3, kEnd}}, 1), kEnd);
}

TEST(Keyframes, RotateTheShortWay) {
  const std::vector<Keyframe> keys{{0, Matrix4::rotation(0, 1, 0, 170)}, {1, Matrix4::rotation(0, 1, 0, -170)}};
  expectNear(poseAt(keys, 0.5), Matrix4::rotation(0, 1, 0, 180));
  expectNear(poseAt(keys, 0.25), Matrix4::rotation(0, 1, 0, 175));
  // Half a turn: which way is not said, but it is at constant speed and stays a rotation.
  const std::vector<Keyframe> half{{0, Matrix4()}, {1, Matrix4::rotation(0.3, 1, 0.2, 180)}};
  EXPECT_NEAR(poseAt(half, 0.3).determinant3(), 1, 1e-12);
}

TEST(Keyframes, MirrorImagesStayMirrored) {
  const Matrix4 mirror = Matrix4::rotation(0, 0, 1, 30) * Matrix4::scaling(-1, 1, 1);
  const std::vector<Keyframe> keys{{0, mirror}, {1, Matrix4::translation(0, 5, 0) * mirror}};
  expectNear(poseAt(keys, 0.5), Matrix4::translation(0, 2.5, 0) * mirror);
}

TEST(Keyframes, OfAnySize) {
  for (const double size : {1e-6, 1e6}) {
    const Matrix4 scale = Matrix4::scaling(size, size, size);
    const std::vector<Keyframe> keys{{0, scale}, {1, Matrix4::rotation(1, 0, 0, 90) * scale}};
    expectNear(poseAt(keys, 0.5), Matrix4::rotation(1, 0, 0, 45) * scale, 1e-12 * size);
  }
}

}  // namespace
}  // namespace virga
