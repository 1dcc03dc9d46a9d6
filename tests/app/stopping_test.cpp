// SPDX-License-Identifier: Apache-2.0
#include "app/stopping.h"

#include <gtest/gtest.h>

#include <vector>

namespace virga::app {
namespace {

TEST(Stopping, NothingStopsBeforeTheFirstPass) {
  const StopRules rules{.passes = 1, .seconds = 1, .relMse = 1};
  EXPECT_FALSE(stopReason(rules, {.passes = 0, .seconds = 100, .interrupted = true}));
}

TEST(Stopping, StopsAtThePasses) {
  const StopRules rules{.passes = 4};
  EXPECT_FALSE(stopReason(rules, {.passes = 3, .seconds = 1e6}));
  EXPECT_EQ(stopReason(rules, {.passes = 4}), StopReason::passes);
}

TEST(Stopping, APassIsBegunUnlessMostOfItWouldBeLate) {
  const StopRules rules{.seconds = 10};
  EXPECT_FALSE(stopReason(rules, {.passes = 9, .seconds = 9}));    // the tenth ends at 10
  EXPECT_FALSE(stopReason(rules, {.passes = 3, .seconds = 8.5}));  // the fourth at 11.3: 1.3 late, 1.5 in time
  EXPECT_EQ(stopReason(rules, {.passes = 3, .seconds = 9}), StopReason::time);  // at 12: 2 late, 1 in time
  EXPECT_EQ(stopReason(rules, {.passes = 1, .seconds = 60}), StopReason::time);
}

TEST(Stopping, AnErrorNeedsTwoPassesInEachReplicate) {
  const StopRules rules{.relMse = 1e-2};
  EXPECT_FALSE(stopReason(rules, {.passes = 8, .relMse = 1e-3, .relMsePasses = 8}));
  EXPECT_FALSE(stopReason(rules, {.passes = 16, .relMse = 1e-3, .relMsePasses = 15}));
  EXPECT_FALSE(stopReason(rules, {.passes = 16, .relMse = 2e-2, .relMsePasses = 16}));
  EXPECT_FALSE(stopReason(rules, {.passes = 16}));
  EXPECT_EQ(stopReason(rules, {.passes = 16, .relMse = 1e-2, .relMsePasses = 16}), StopReason::error);
}

TEST(Stopping, TheFirstRuleCounts) {
  const StopRules rules{.passes = 100, .seconds = 10, .relMse = 1e-2};
  EXPECT_EQ(stopReason(rules, {.passes = 100, .seconds = 1}), StopReason::passes);
  EXPECT_EQ(stopReason(rules, {.passes = 50, .seconds = 10}), StopReason::time);
  EXPECT_EQ(stopReason(rules, {.passes = 50, .seconds = 1, .relMse = 1e-3, .relMsePasses = 48}), StopReason::error);
  EXPECT_EQ(stopReason(rules, {.passes = 50, .seconds = 1, .converged = true}), StopReason::converged);
  EXPECT_EQ(stopReason(rules, {.passes = 50, .seconds = 1, .interrupted = true}), StopReason::interrupted);
}

TEST(Stopping, TellsWhatIsLeft) {
  EXPECT_FALSE(secondsLeft({.passes = 4}, {}));
  EXPECT_DOUBLE_EQ(*secondsLeft({.passes = 4}, {.passes = 1, .seconds = 2}), 6);
  EXPECT_DOUBLE_EQ(*secondsLeft({.passes = 4, .seconds = 5}, {.passes = 1, .seconds = 2}), 3);
  // From 4e-2 at 16 passes to 1e-2: 64 passes, 40 to go at half a second each.
  EXPECT_DOUBLE_EQ(*secondsLeft({.relMse = 1e-2}, {.passes = 24, .seconds = 12, .relMse = 4e-2, .relMsePasses = 16}),
                   20);
  EXPECT_DOUBLE_EQ(*secondsLeft({.seconds = 5}, {.passes = 1, .seconds = 9}), 0);
}

TEST(Stopping, TellsHowMuchIsDone) {
  EXPECT_EQ(fractionDone({.passes = 4}, {}), 0);
  EXPECT_DOUBLE_EQ(fractionDone({.passes = 4, .seconds = 10}, {.passes = 1, .seconds = 5}), 0.5);
  EXPECT_DOUBLE_EQ(fractionDone({.relMse = 1e-2}, {.passes = 32, .seconds = 1, .relMse = 4e-2, .relMsePasses = 16}),
                   0.5);
  EXPECT_EQ(fractionDone({.seconds = 1}, {.passes = 1, .seconds = 5}), 1);
}

TEST(ErrorSchedule, WholeRoundsFromTheFirstOn) {
  ErrorSchedule schedule;
  std::vector<int64_t> due;
  for (int64_t passes = 1; passes <= 400; ++passes)
    if (schedule.due(passes)) due.push_back(passes);
  ASSERT_GE(due.size(), 6u);
  EXPECT_EQ(std::vector<int64_t>(due.begin(), due.begin() + 5), (std::vector<int64_t>{2, 4, 8, 16, 24}));
  for (size_t i = 2; i < due.size(); ++i) {
    EXPECT_EQ(due[i] % 8, 0);
    EXPECT_LE(static_cast<double>(due[i] - due[i - 1]), std::max(8.0, 0.1 * static_cast<double>(due[i])));
  }
}

}  // namespace
}  // namespace virga::app
