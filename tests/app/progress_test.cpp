// SPDX-License-Identifier: Apache-2.0
#include "app/progress.h"

#include <gtest/gtest.h>

namespace virga::app {
namespace {

TEST(Progress, Durations) {
  EXPECT_EQ(durationText(0.123), "0.12 s");
  EXPECT_EQ(durationText(3.21), "3.2 s");
  EXPECT_EQ(durationText(9.97), "10 s");
  EXPECT_EQ(durationText(59.4), "59 s");
  EXPECT_EQ(durationText(59.6), "1 min 00 s");
  EXPECT_EQ(durationText(200), "3 min 20 s");
  EXPECT_EQ(durationText(2 * 3600 + 5 * 60 + 7), "2 h 05 min");
  EXPECT_EQ(durationText(3.0 * 86400), "3 days");
  EXPECT_EQ(durationText(1e12), "more than 10 years");
}

TEST(Progress, Bytes) {
  EXPECT_EQ(bytesText(0), "0 B");
  EXPECT_EQ(bytesText(999), "999 B");
  EXPECT_EQ(bytesText(8.39e6), "8.39 MB");
  EXPECT_EQ(bytesText(1.2e9), "1.2 GB");
}

TEST(Progress, TellsPassesTimeErrorAndRest) {
  EXPECT_EQ(progressText({.passes = 64}, {}), "0/64 passes, 0.00 s");
  EXPECT_EQ(progressText({.passes = 64}, {.passes = 16, .seconds = 4, .relMse = 1.24e-3, .relMsePasses = 16}),
            "16/64 passes, 4.0 s, error 1.2e-03, 12 s left");
  EXPECT_EQ(progressText({.seconds = 10}, {.passes = 1, .seconds = 4}), "1 pass, 4.0 s, 6.0 s left");
}

TEST(Progress, AnOldEstimateIsBroughtToTheNewPasses) {
  const RenderState state{.passes = 15, .seconds = 4, .relMse = 3e-3, .relMsePasses = 8};
  EXPECT_EQ(progressText({}, state), "15 passes, 4.0 s, error 1.6e-03");
  EXPECT_FALSE(relMseNow({.passes = 15}));
}

TEST(Progress, AnErrorOfSomePixelsIsNotThatOfThePicture) {
  EXPECT_EQ(progressText({}, {.passes = 8, .seconds = 4, .relMse = 0, .relMsePasses = 8, .hasNonFinite = true}),
            "8 passes, 4.0 s, error 0.0e+00 of the finite pixels");
}

TEST(Progress, Bar) {
  EXPECT_EQ(barText(0, 4), "[----]");
  EXPECT_EQ(barText(0.5, 4), "[##--]");
  EXPECT_EQ(barText(1, 4), "[####]");
}

}  // namespace
}  // namespace virga::app
