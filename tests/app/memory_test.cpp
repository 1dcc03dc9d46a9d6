// SPDX-License-Identifier: Apache-2.0
// What a volume takes while it is loaded and rendered.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "app/program.h"

namespace virga::app {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;  // every byte has others beside it
#else
constexpr bool kSanitized = false;
#endif

constexpr int kSide = 160;
constexpr double kBytes = 4. * kSide * kSide * kSide;

/// Peak of a render [bytes] of fog of side^3 voxels, all of them different. They are made by another process: what a
/// process is born with counts as its own peak.
double peak(const Scratch& scratch, int side, const std::string& extension) {
  const std::string file = "fog" + extension;
  EXPECT_EQ(virga(scratch, {"make", "fog", "--resolution", std::to_string(side), "-o", file}).exitCode, 0);
  const Ended r =
      virga(scratch, {"render", file, "--size", "16x16", "--passes", "1", "-o", "m.exr", "--stats", "m.json"});
  EXPECT_EQ(r.exitCode, 0) << r.err;
  return nlohmann::json::parse(scratch.read("m.json"))["peak_resident_bytes"].get<double>();
}

// docs/results/memory.md
TEST(Memory, LoadingADenseGridTakesAtMostTwoAndAHalfTimesItsBytes) {
  if (kSanitized) GTEST_SKIP();
  const Scratch scratch;
  const double own = peak(scratch, kSide, ".vol") - peak(scratch, 8, ".vol");
  EXPECT_LT(own, 2.5 * kBytes) << own / kBytes;
  EXPECT_GT(own, 0.9 * kBytes) << "it is there";
}

}  // namespace
}  // namespace virga::app
