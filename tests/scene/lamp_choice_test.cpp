// SPDX-License-Identifier: Apache-2.0
// Which lamp is asked for the light at a place: LampShares.
#include "scene/lamp_choice.h"

#include <gtest/gtest.h>

#include <numeric>

#include "scene/scenes.h"

namespace virga {
namespace {

enum Lamp : size_t { panel, point, spot, dark, sky };  // lamps on shapes come first

SceneSnapshot fourLampsAndADarkOne() {
  return test::build(R"(
    <emitter type="point"><point name="position" x="4" y="0" z="0"/><rgb name="intensity" value="100"/></emitter>
    <emitter type="spot"><transform name="to_world"><lookat origin="0, 2, 0" target="0, 0, 0" up="1, 0, 0"/></transform>
      <rgb name="intensity" value="20"/><float name="cutoff_angle" value="20"/></emitter>
    <emitter type="point"><rgb name="intensity" value="0"/></emitter>
    <emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>
    <shape type="rectangle"><transform name="to_world"><scale value="0.1"/><translate x="0" y="0" z="-2"/></transform>
      <emitter type="area"><rgb name="radiance" value="50"/></emitter></shape>)");
}

std::vector<double> sharesAt(const SceneView& view, Vec3 p) {
  std::vector<double> shares;
  for (int i = 0; i < view.emitters.size; ++i) shares.push_back(static_cast<double>(emitterProbability(view, p, i)));
  return shares;
}

TEST(LampChoice, IsDrawnWithItsProbability) {
  const SceneSnapshot scene = fourLampsAndADarkOne();
  for (const Vec3 p : {Vec3(0, 0, 0), Vec3(3.9f, 0, 0), Vec3(0, 1.9f, 0.3f), Vec3(4, 0, 0), Vec3(0, 0, -3)}) {
    const std::vector<double> shares = sharesAt(scene->view, p);
    EXPECT_NEAR(std::accumulate(shares.begin(), shares.end(), 0.), 1, 1e-5);
    std::vector<double> drawn(shares.size());
    constexpr int kDraws = 20000;
    for (int i = 0; i < kDraws; ++i) {
      const EmitterChoice choice =
          chooseEmitter(scene->view, p, (static_cast<float>(i) + 0.5f) / static_cast<float>(kDraws));
      EXPECT_NEAR(static_cast<double>(choice.probability), shares[static_cast<size_t>(choice.emitter)], 1e-6);
      drawn[static_cast<size_t>(choice.emitter)] += 1. / kDraws;
    }
    for (size_t i = 0; i < shares.size(); ++i) EXPECT_NEAR(drawn[i], shares[i], 1e-3) << i;
    EXPECT_EQ(shares[dark], 0) << "a dark lamp";
    for (const size_t shines : {panel, point, spot, sky})
      EXPECT_GT(shares[shines], 0.06) << "something may be in the way of others";
  }
}

TEST(LampChoice, FollowsTheLight) {
  const SceneSnapshot scene = fourLampsAndADarkOne();
  // At the origin they send 100 / 16, 20 / 4, pi / 10 and 50 * 0.04 / 4.
  const std::vector<double> middle = sharesAt(scene->view, {0, 0, 0});
  const double sum = 100. / 16 + 20. / 4 + 0.1 * 3.14159265 + 50 * 0.04 / 4;
  EXPECT_NEAR(middle[point], 0.75 * (100. / 16) / sum + 0.0625, 1e-3);
  EXPECT_NEAR(middle[spot], 0.75 * (20. / 4) / sum + 0.0625, 1e-3);
  EXPECT_NEAR(middle[sky], 0.75 * (0.1 * 3.14159265) / sum + 0.0625, 1e-3);
  EXPECT_NEAR(middle[panel], 0.75 * (50 * 0.04 / 4) / sum + 0.0625, 1e-2);
  EXPECT_GT(sharesAt(scene->view, {3.9f, 0, 0})[point], 0.8) << "beside the point light";
  EXPECT_GT(sharesAt(scene->view, {0, 1.9f, 0})[spot], 0.8) << "in the beam";
  EXPECT_LT(sharesAt(scene->view, {0.8f, 1.4f, 0})[spot], 0.3) << "beside the beam";
  EXPECT_LT(sharesAt(scene->view, {0, 0, -2.2f})[panel], sharesAt(scene->view, {0, 0, -1.8f})[panel])
      << "behind the panel";
}

TEST(LampChoice, OfManyIsByPower) {
  std::string lamps;
  for (int i = 0; i < 40; ++i)
    lamps +=
        "<emitter type=\"point\"><point name=\"position\" x=\"" + std::to_string(i) + "\" y=\"0\" z=\"0\"/></emitter>";
  const SceneSnapshot scene = test::build(lamps);
  for (int i = 0; i < 40; ++i) EXPECT_NEAR(emitterProbability(scene->view, {3, 0.1f, 0}, i), 1. / 40, 1e-5);
}

}  // namespace
}  // namespace virga
