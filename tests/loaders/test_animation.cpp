// SPDX-License-Identifier: Apache-2.0
#include "core/keyframes.h"
#include "loaders/loading.h"

namespace virga::loading {
namespace {

const std::string kKeys = R"(<transform time="2"><scale value="2"/></transform>
  <transform time="6"><scale value="4"/><translate x="8"/></transform>)";

Matrix4 poseIn(const std::string& before, const LoadOptions& options = {}) {
  const SceneDescription read = parse(scene(before + "<animation name=\"x\">" + kKeys + "</animation>"), options);
  return valueOf<Matrix4>(*read.root, "x");
}

LoadOptions atFrame(const std::string& text) { return {.defines = {{"frame", text}}}; }

TEST(Animation, IsThePoseOfItsFrame) {
  const Keyframe keys[] = {{2, Matrix4::scaling(2, 2, 2)},
                           {6, Matrix4::translation(8, 0, 0) * Matrix4::scaling(4, 4, 4)}};
  EXPECT_EQ(poseIn("", atFrame("0002")), keys[0].pose);
  EXPECT_EQ(poseIn("", atFrame("0006")), keys[1].pose);
  EXPECT_EQ(poseIn("", atFrame("3.5")), poseAt(keys, 3.5));
  EXPECT_EQ(poseIn("<default name=\"frame\" value=\"0005\"/>"), poseAt(keys, 5));
  EXPECT_EQ(poseIn("<default name=\"frame\" value=\"0005\"/>", atFrame("4")), poseAt(keys, 4));
  EXPECT_EQ(poseIn(""), keys[0].pose) << "without a frame, the first";
}

TEST(Animation, OfAnOldSceneIsReadToo) {
  const SceneDescription read = parse(R"(<scene version="0.6.0"><animation name="toWorld">
    <transform time="0"><lookAt origin="0,0,1" target="0,0,0" up="0,1,0"/></transform></animation></scene>)");
  EXPECT_EQ(valueOf<Matrix4>(*read.root, "to_world"), Matrix4::lookAt({0, 0, 1}, {0, 0, 0}, {0, 1, 0}));
}

TEST(Animation, MistakesAreErrorsWithTheirPlace) {
  expectError(scene("<[[animation]] name=\"x\"/>"), "keyframes");
  expectError(scene("<animation name=\"x\"><[[transform]]/></animation>"), "time");
  expectError(scene(R"(<animation name="x"><transform time="3"/><transform time="[[3]]"/></animation>)"), "increase");
  expectError(scene(R"(<animation name="x"><transform time="[[now]]"/></animation>)"), "now");
  expectError(scene(R"(<animation name="x"><[[translate]] x="1"/></animation>)"), "transform");
  expectError(scene(R"(<animation name="x"><[[transform]] time="1"><scale x="0"/></transform></animation>)"), "flat");
  expectError(scene(R"(<[[animation]] name="x"><transform time="1"/></animation>)"), "no number", atFrame("late"));
}

}  // namespace
}  // namespace virga::loading
