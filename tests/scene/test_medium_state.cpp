// SPDX-License-Identifier: Apache-2.0
// Which media a point lies in must follow from the point, not from the way there.
#include <gtest/gtest.h>

#include <vector>

#include "scene/medium.h"

namespace virga {
namespace {

constexpr int kNone = MediumTransition::kNone;
constexpr int kFog = 0, kCloud = 1, kFluid = 2, kSmoke = 3;
constexpr int kFogBox = 10, kCloudBox = 11, kSmokeBox = 12;

std::vector<int> mediaOf(const MediaState& state) {
  std::vector<int> media;
  for (int i = 0; i < state.count(); ++i) media.push_back(state.medium(i));
  return media;
}

using Media = std::vector<int>;

MediaState inFog() {
  MediaState state;
  state.enter(kFogBox, kFog);
  return state;
}

TEST(MediaState, AfterAShapeThatReplacesAllItsSurroundingsAreBack) {
  MediaState state = inFog();
  state.enter(kCloudBox, kCloud);
  const MediumTransition flask{kFluid, kFog, true};
  state.pass(flask, Passing::inward);
  EXPECT_EQ(mediaOf(state), Media{kFluid});
  state.pass(flask, Passing::outward);
  EXPECT_EQ(mediaOf(state), (Media{kFog, kCloud})) << "the exterior is one of them";
  state.leave(kFogBox, kFog);
  EXPECT_EQ(mediaOf(state), Media{kCloud});
}

TEST(MediaState, WhatIsEnteredLaterAdds) {
  MediaState state = inFog();
  const MediumTransition flask{kFluid, kFog, true};
  state.pass(flask, Passing::inward);
  state.pass(flask, Passing::outward);
  state.enter(kCloudBox, kCloud);
  EXPECT_EQ(mediaOf(state), (Media{kFog, kCloud})) << "as on a way that did not lead through the flask";
}

TEST(MediaState, ABubbleIsEmpty) {
  MediaState state = inFog();
  const MediumTransition bubble{kNone, kFog, true};
  state.pass(bubble, Passing::inward);
  EXPECT_TRUE(state.vacuum());
  state.enter(kSmokeBox, kSmoke);
  EXPECT_EQ(mediaOf(state), Media{kSmoke}) << "what lies in it is there";
  state.leave(kSmokeBox, kSmoke);
  EXPECT_TRUE(state.vacuum());
  state.pass(bubble, Passing::outward);
  EXPECT_EQ(mediaOf(state), Media{kFog});
}

TEST(MediaState, AnExteriorThatIsNowhereDeclaredOtherwiseReplaces) {
  MediaState state = inFog();
  const MediumTransition flask{kFluid, kSmoke, true};
  state.pass(flask, Passing::inward);
  state.pass(flask, Passing::outward);
  EXPECT_EQ(mediaOf(state), Media{kSmoke});
}

TEST(MediaState, LeavingWhatIsHiddenLeavesTheRestHidden) {
  MediaState state = inFog();
  state.enter(kCloudBox, kCloud);
  state.pass({kNone, kFog, true}, Passing::inward);
  state.leave(kCloudBox, kCloud);
  EXPECT_TRUE(state.vacuum());
  state.enter(kSmokeBox, kSmoke);
  EXPECT_EQ(mediaOf(state), Media{kSmoke});
}

}  // namespace
}  // namespace virga
