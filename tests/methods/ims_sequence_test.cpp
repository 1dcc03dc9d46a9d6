// SPDX-License-Identifier: Apache-2.0
// Frames of a sequence whose walks were kept from the frame before, against frames from scratch: layer by layer the
// same in expectation.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "methods/ims_checks.h"

namespace virga {
namespace {

using namespace virga::testing;
using brute::Vector;
using brute::World;

/// Smoke in a room that a lamp on the ceiling lights.
SceneSnapshot roomWith(const brute::Grid& density, double sigmaT, const std::string& name) {
  World w;
  w.eye = {0.5, 0.2, 3.6};
  w.fieldOfView = 35;
  w.size = 16;
  w.maxDepth = 6;
  w.rectangles = {floorAt(-1, 2, matt(0.6, 0.5, 0.4)),
                  ceilingAt(1.2, 1, light(4, 3.5, 3)),
                  {{0, 0, -1.2}, {2, 0, 0}, {0, 2, 0}, matt(0.3, 0.5, 0.7)}};
  brute::Region box{.form = brute::Region::Form::box, .lo = {-0.8, -1, -0.9}, .hi = {0.9, 1.1, 0.8}, .medium = {}};
  box.medium.sigmaT = sigmaT, box.medium.albedo = {0.95, 0.9, 0.8}, box.medium.density = density;
  w.regions.push_back(box);
  const std::string unique =
      fmt::format("{}_{}_{}", ::testing::UnitTest::GetInstance()->current_test_info()->name(), name, ::getpid());
  return sceneOf(brute::sceneElements(w, ::testing::TempDir(), unique), ::testing::TempDir());
}

constexpr int kSize = 16;

brute::Grid ballAt(double cx, double cy) {
  return gridOf(kSize, [&](double x, double y, double z) {
    const double r = std::hypot(x - cx, y - cy, z - 0.5) / 0.35, d = r < 1 ? 1 - r * r : 0;
    return Vector{d, d, d};
  });
}

/// `next` after `before` in one session, again and again: means of all layers.
Estimates afterFrame(const SceneSnapshot& before, const SceneSnapshot& next, const SettingValues& settings, int sets) {
  Estimates result;
  for (int s = 0; s < sets; ++s) {
    RenderSession session = rendered(before, {.passes = Film::kReplicates,
                                              .seed = 5000 + static_cast<uint64_t>(s),
                                              .layers = LayerMask::all(),
                                              .method = "ims",
                                              .settings = settings});
    session.nextFrame(next, differences(before->description, next->description));
    for (int i = 0; i < Film::kReplicates; ++i) session.step();
    result.nonFinite += session.film().nonFiniteSamples();
    for (int r = 0; r < Film::kReplicates; ++r) result.add(session.film(), r);
  }
  return result;
}

struct Case {
  std::string name;
  SceneSnapshot before, next;
  std::string retrace = "0";
  std::vector<Power> powers = {};
  SettingValues settings = {{"walks", "256"}, {"lights", "4"}};
};

void expectFramesAgree(const Case& c, int sets) {
  const Estimates fresh = estimates(c.next, "ims", c.settings, {.sets = sets, .seed = 3});
  SettingValues keeping = c.settings;
  keeping["retrace"] = c.retrace;
  const Estimates kept = afterFrame(c.before, c.next, keeping, sets);
  expectSame(kept, fresh, c.name);
  expectPower(kept, fresh, c.powers, c.name);
  // As if nothing had been done about the change.
  const Estimates stale = estimates(c.before, "ims", c.settings, {.sets = sets, .seed = 4});
  EXPECT_LT(differenceOf(stale, fresh, static_cast<size_t>(Layer::surfaceToSurface)).p, kDisagree) << c.name;
}

const std::vector<Power> kPowers = {{Layer::surfaceToSurface, 0.03},
                                    {Layer::mediaToSurface, 0.06},
                                    {Layer::surfaceToMedia, 0.05},
                                    {Layer::mediaToMedia, 0.05}};

TEST(ImsSequence, DensityThatChangesInPlace) {
  expectFramesAgree({"thinner", roomWith(plume(), 9, "a"), roomWith(plume(), 4, "b"), "0", kPowers}, 24);
}

TEST(ImsSequence, SmokeThatMovesIntoEmptySpace) {
  const SceneSnapshot here = roomWith(ballAt(0.35, 0.4), 6, "here"), there = roomWith(ballAt(0.5, 0.5), 6, "there");
  expectFramesAgree({"none traced anew", here, there, "0", kPowers}, 40);
  expectFramesAgree({"half of them traced anew", here, there, "0.5", kPowers}, 24);
}

TEST(ImsSequence, SmokeThatVanishes) {
  const brute::Grid nothing = gridOf(kSize, [](double, double, double) { return Vector{}; });
  expectFramesAgree({"nothing is left",
                     roomWith(ballAt(0.5, 0.5), 6, "smoke"),
                     roomWith(nothing, 6, "nothing"),
                     "0",
                     {{Layer::surfaceToSurface, 0.03}}},
                    24);
}

// Frames keep walks, the choice of their lights and shadow maps. Their radius is given, lest the lights' spacing decide
// it.
const SettingValues kFrame = {
    {"mode", "frame"}, {"walks", "2048"}, {"lights", "256"}, {"radius", "0.3"}, {"spacing", "4"}};

TEST(ImsSequence, FramesOfDensityThatChangesInPlace) {
  expectFramesAgree({"none", roomWith(plume(), 9, "a"), roomWith(plume(), 4, "b"), "0", kPowers, kFrame}, 6);
}
TEST(ImsSequence, FramesOfSmokeThatMovesIntoEmptySpace) {
  const SceneSnapshot here = roomWith(ballAt(0.35, 0.4), 6, "here"), there = roomWith(ballAt(0.5, 0.5), 6, "there");
  expectFramesAgree({"none traced anew", here, there, "0", kPowers, kFrame}, 8);
}

}  // namespace
}  // namespace virga
