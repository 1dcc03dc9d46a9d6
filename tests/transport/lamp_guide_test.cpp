// SPDX-License-Identifier: Apache-2.0
#include "transport/lamp_guide.h"

#include <gtest/gtest.h>

#include "stats/stats.h"

namespace virga {
namespace {

const Vec3 kAxis = normalize(Vec3(0.3f, -0.5f, 0.8f));
/// In a medium, and on surfaces that face the lamp, turn away from it, and see it at a grazing angle.
const Vec3 kNormals[] = {Vec3(0), kAxis, -kAxis, normalize(cross(kAxis, Vec3(1, 0, 0))), normalize(Vec3(1, 2, -1))};

LampGuide guideToward(Vec3 axis) {
  LampGuide guide;
  guide.axis = axis;
  guide.guide(1, 1);
  return guide;
}

double samplingP(Vec3 normal, const LampGuide& claimed) {
  const LampGuide guide = guideToward(kAxis);
  return stats::chiSquared(
      {}, [&](Vec2 u) { return std::optional(guide.sample(normal, u)); },
      [&](Vec3 w) { return static_cast<double>(claimed.pdf(normal, w)); });
}

TEST(LampGuide, DirectionsHaveTheDensityThatIsClaimed) {
  for (const Vec3 n : kNormals) EXPECT_GT(samplingP(n, guideToward(kAxis)), 1e-4) << n.x << ' ' << n.y << ' ' << n.z;
}
TEST(LampGuide, AWrongDensityIsNoticed) {
  for (const Vec3 n : kNormals)
    EXPECT_LT(samplingP(n, guideToward(normalize(kAxis + Vec3(0.05f, 0, 0)))), 1e-6) << n.x << ' ' << n.y << ' ' << n.z;
}

TEST(LampGuide, LeavesTheSideOfTheSurfaceToOthers) {
  const LampGuide guide = guideToward(kAxis);
  EXPECT_EQ(guide.pdf(kAxis, -kAxis), 0);
  EXPECT_FLOAT_EQ(guide.mixture(0.25f, kAxis, -kAxis), 0.25f * (1 - LampGuide::kMostShare));
  EXPECT_EQ(LampGuide{}.mixture(0.25f, kAxis, kAxis), 0.25f);
}

}  // namespace
}  // namespace virga
