// SPDX-License-Identifier: Apache-2.0
// What the options of `ims` do to the expectation of the picture: nothing, or what they say.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "methods/ims_checks.h"

namespace virga {
namespace {

using namespace virga::testing;
using brute::Phase;
using brute::Vector;
using brute::World;

/// Fog over a floor, a wall, a box of denser fog in it; dense enough for clamping to take a good share.
World denseFog() {
  World w;
  w.eye = {0.3, 0.3, 3.4};
  w.fieldOfView = 36;
  w.size = 20;
  w.maxDepth = 8;
  w.rectangles = {floorAt(-1, 1.4, matt(0.8, 0.7, 0.6)),
                  ceilingAt(1.1, 0.9, light(3, 3, 2)),
                  {{0, 0.1, -1.6}, {1.4, 0, 0}, {0, 0.9, 0}, matt(0.7, 0.7, 0.8)}};
  w.regions = {{.lo = {-1.3, -1, -1}, .hi = {1.3, 1.05, 1}, .medium = {.sigmaT = 0.8, .albedo = {0.95, 0.9, 0.9}}},
               {.lo = {-0.6, -0.9, -0.5},
                .hi = {0.6, 0.3, 0.6},
                .medium = {.sigmaT = 2, .albedo = {0.9, 0.95, 0.95}, .lobe = {Phase::henyeyGreenstein, 0.3}}}};
  return w;
}

const std::vector<Layer> kIndirect = {Layer::surfaceToSurface, Layer::mediaToSurface, Layer::surfaceToMedia,
                                      Layer::mediaToMedia};

class ImsOptionsTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    scene_ = sceneOf(elementsOf(denseFog()));
    truth_ = estimates(scene_, "path", {}, {.sets = 60});
  }
  static void TearDownTestSuite() {
    scene_.reset();
    truth_ = {};
  }
  static Estimates of(SettingValues settings, const Trials& trials = {.sets = 20}) {
    settings.insert({{"walks", "1024"}, {"radius", "0.6"}});
    return estimates(scene_, "ims", settings, trials);
  }
  static SceneSnapshot scene_;
  static Estimates truth_;
};
SceneSnapshot ImsOptionsTest::scene_;
Estimates ImsOptionsTest::truth_;

/// Means of the indirect layers together, one for each replicate, of green.
stats::Moments indirect(const Estimates& e) {
  stats::Moments m;
  for (int64_t i = 0; i < e.at(0, 4, 1).count(); ++i) {
    double sum = 0;
    for (const Layer layer : kIndirect) sum += e.value(static_cast<size_t>(layer), 4, 1, static_cast<size_t>(i));
    m.add(sum);
  }
  return m;
}

// Layer by layer, by the linearity of means.
TEST_F(ImsOptionsTest, ClampedAndCompensatedLightAreThePicture) {
  const Estimates clamped = of({{"compensation", "none"}}, {.sets = 40, .seed = 4});
  const Estimates found = of({{"show", "compensation"}, {"compensation", "sampled"}}, {.sets = 40, .seed = 5});
  for (const Layer layer : kIndirect) {
    const auto l = static_cast<size_t>(layer);
    for (int c = 0; c < 3; ++c) {
      const stats::Moments &a = clamped.at(l, 4, c), &b = found.at(l, 4, c), &t = truth_.at(l, 4, c);
      const double error = std::hypot(a.standardError(), std::hypot(b.standardError(), t.standardError()));
      EXPECT_NEAR(a.mean() + b.mean(), t.mean(), 4.5 * error) << kLayerNames[l];
      EXPECT_LT(error, 0.07 * t.mean()) << kLayerNames[l] << ": too few samples to tell";
    }
    if (layer == Layer::surfaceToSurface) continue;  // surfaces are too far apart for it to lose much
    EXPECT_LT(differenceOf(clamped, truth_, l).p, kDisagree) << "the test cannot fail: " << kLayerNames[l];
  }
  for (const Layer direct : {Layer::emission, Layer::directSurface, Layer::directMedia})
    EXPECT_EQ(found.level(static_cast<size_t>(direct)), 0);
}

// What clamping takes has infinite variance in media (1 / r^2 in three dimensions): its means come near their limit
// with the cube root of the count alone, from below as a rule. Hence many lights, and a tolerance.
TEST_F(ImsOptionsTest, WhatIsLostIsWhatCompensationFinds) {
  const Estimates lost = of({{"show", "lost"}, {"walks", "8192"}, {"lights", "64"}}, {.sets = 12, .seed = 2});
  const Estimates found = of({{"show", "compensation"}, {"compensation", "sampled"}}, {.sets = 20, .seed = 3});
  for (const Layer layer : {Layer::mediaToSurface, Layer::surfaceToMedia, Layer::mediaToMedia}) {
    const auto l = static_cast<size_t>(layer);
    fmt::print("{}: lost {:.5f}, found {:.5f}\n", kLayerNames[l], lost.level(l), found.level(l));
    EXPECT_NEAR(lost.level(l) / found.level(l), 1, layer == Layer::mediaToMedia ? 0.06 : 0.25) << kLayerNames[l];
  }
  for (const Layer direct : {Layer::emission, Layer::directSurface, Layer::directMedia})
    EXPECT_EQ(lost.level(static_cast<size_t>(direct)), 0);
}

struct Option {
  const char* name;
  SettingValues settings;
};

TEST_F(ImsOptionsTest, UnbiasedOnes) {
  const Option options[] = {
      {"one level, then unclamped lights", {{"compensation", "sampled"}, {"levels", "1"}}},
      {"two levels", {{"compensation", "sampled"}, {"levels", "2"}, {"v1", "2"}, {"v2", "3"}}},
      {"three levels", {{"compensation", "sampled"}, {"levels", "3"}, {"p1", "1"}}},
      {"whole walks", {{"compensation", "sampled"}, {"paths", "4"}, {"p1", "2"}, {"p2", "1"}, {"v1", "2"}}},
      {"whole walks, by path", {{"paths", "3"}}},
      {"more walks than there are", {{"paths", "100"}, {"walks", "40"}}},
      {"one light", {{"lights", "1"}}},
      {"more lights than there are", {{"walks", "30"}, {"lights", "100"}}},
      {"a bound", {{"bound", "2"}}},
      {"roulette late", {{"rr_depth", "6"}, {"compensation", "sampled"}}}};
  Estimates all;
  uint64_t seed = 10;
  for (const Option& option : options) {
    SettingValues settings = option.settings;
    if (!settings.contains("bound")) settings.insert({"radius", "0.6"});
    settings.insert({"walks", "1024"});
    const Estimates found = estimates(scene_, "ims", settings, {.sets = 14, .seed = ++seed});
    expectSame(found, truth_, option.name);
    all.add(found);
  }
  expectSame(all, truth_, "all together");
  expectPower(all, truth_,
              {{Layer::surfaceToSurface, 0.08},
               {Layer::mediaToSurface, 0.03},
               {Layer::surfaceToMedia, 0.03},
               {Layer::mediaToMedia, 0.01}},
              "all together");
}

// Darker by what the last level's clamping takes: nothing more than no level at all would lose, less with each level,
// and less where the bound is only raised.
TEST_F(ImsOptionsTest, EndingsThatLoseLight) {
  const auto lit = [&](const SettingValues& settings, uint64_t seed) {
    return indirect(of(settings, {.sets = 24, .seed = seed}));
  };
  const auto level = [](const char* levels, const char* ending) {
    return SettingValues{{"compensation", "sampled"}, {"levels", levels}, {"ending", ending}};
  };
  const stats::Moments none = lit({{"compensation", "none"}}, 31), one = lit(level("1", "nothing"), 32),
                       two = lit(level("2", "nothing"), 33), reduced = lit(level("1", "reduced"), 34),
                       all = lit({{"compensation", "sampled"}}, 35);
  fmt::print("clamped {:.4f}, one level {:.4f}, two {:.4f}, one with reduced clamping {:.4f}, all {:.4f} (+- {:.4f})\n",
             none.mean(), one.mean(), two.mean(), reduced.mean(), all.mean(), all.standardError());
  const auto brighter = [](const stats::Moments& a, const stats::Moments& b) {
    return a.mean() - b.mean() > 4 * std::hypot(a.standardError(), b.standardError());
  };
  EXPECT_TRUE(brighter(one, none));
  EXPECT_TRUE(brighter(all, one));
  // Each level finds about the same share of what was lost before it: q = lost(1) / lost(0), lost(2) = q lost(1).
  const double lost = all.mean() - none.mean(), share = (all.mean() - one.mean()) / lost;
  const double error = 4 * std::hypot(all.standardError(), two.standardError());
  EXPECT_NEAR(two.mean(), all.mean() - share * share * lost, error + 0.1 * share * lost);
  EXPECT_GT(reduced.mean(), one.mean());
  EXPECT_LT(reduced.mean(), all.mean() + error);
}

bool flaggedBiased(const SceneSnapshot& scene, const SettingValues& settings) {
  RenderSession session(scene, findMethod("ims"), {.settings = {.values = settings, .seed = 1}, .layers = {}});
  return session.step().biased;
}

TEST_F(ImsOptionsTest, BiasIsDeclared) {
  const SettingValues biased[] = {{{"compensation", "none"}},
                                  {{"visibility", "none"}},
                                  {{"show", "lost"}},
                                  {{"show", "compensation"}, {"compensation", "sampled"}},
                                  {{"transmittance", "mean"}, {"compensation", "sampled"}},
                                  {{"levels", "1"}, {"ending", "nothing"}, {"compensation", "sampled"}},
                                  {{"levels", "1"}, {"ending", "reduced"}, {"compensation", "sampled"}}};
  const SettingValues unbiased[] = {{}, {{"compensation", "sampled"}}, {{"levels", "1"}, {"compensation", "sampled"}}};
  for (const SettingValues& settings : biased) EXPECT_TRUE(flaggedBiased(scene_, settings)) << settings.begin()->first;
  for (const SettingValues& settings : unbiased) EXPECT_FALSE(flaggedBiased(scene_, settings));
}

TEST_F(ImsOptionsTest, WhatWouldDoNothingIsRefused) {
  const SettingValues idle[] = {{{"transmittance", "mean"}},
                                {{"levels", "1"}, {"ending", "nothing"}},
                                {{"map_points", "100"}},
                                {{"samples", "4"}},
                                {{"mode", "frame"}, {"paths", "4"}}};
  for (const SettingValues& settings : idle) EXPECT_THROW(flaggedBiased(scene_, settings), Error);
}
TEST_F(ImsOptionsTest, WalksThatFillTheMemoryAreRefused) {
  EXPECT_THROW(flaggedBiased(scene_, {{"walks", "300000000"}}), Error);
}

/// What is compensated of light between media, against exact transmittance.
Difference againstExact(const char* transmittance, const brute::Grid& grid, double sigmaT) {
  World w = denseFog();
  w.regions.pop_back();
  w.regions[0].medium.sigmaT = sigmaT;
  w.regions[0].medium.density = grid;
  const SceneSnapshot scene = sceneOf(elementsOf(w));
  const auto found = [&](const char* way, uint64_t seed) {
    return estimates(scene, "ims",
                     {{"walks", "1024"},
                      {"radius", "0.8"},
                      {"compensation", "sampled"},
                      {"levels", "1"},
                      {"ending", "nothing"},
                      {"show", "compensation"},
                      {"transmittance", way}},
                     {.sets = 32, .seed = seed});
  };
  const Difference d =
      differenceOf(found(transmittance, 1), found("exact", 2), static_cast<size_t>(Layer::mediaToMedia));
  fmt::print("{}: {:+.1f} % of what is compensated, p {:.2g}\n", transmittance, 100 * d.relative, d.p);
  return d;
}

TEST(ImsBias, TheLocalMeanIsNotTheTransmittanceBetweenSheets) {
  const brute::Grid sheets = gridOf(16, [](double x, double, double) {
    const double d = std::fmod(8 * x, 2) < 1 ? 1 : 0;
    return Vector{d, d, d};
  });
  EXPECT_LT(againstExact("mean", sheets, 12).p, kDisagree);
  const Difference found = againstExact("gradient", sheets, 12);  // and the gradient finds where it is not
  EXPECT_GT(found.p, kDisagree);
  EXPECT_LT(found.precision, 0.1);
}
TEST(ImsBias, TheLocalMeanIsTheTransmittanceOfAnEvenGrid) {
  const Difference d = againstExact("mean", gridOf(16, [](double, double, double) { return Vector{1, 1, 1}; }), 4);
  EXPECT_GT(d.p, kDisagree);
  EXPECT_LT(d.precision, 0.1);
}

/// A screen between a lamp and what the eye sees.
TEST(ImsBias, LightPassesSurfacesWhereNothingIsHidden) {
  World w = denseFog();
  w.rectangles = {floorAt(-1, 1.4, matt(0.8, 0.7, 0.6)),
                  {{-0.2, 0, 0}, {0, 0, -1}, {0, 1.2, 0}, {.diffuse = {0.3, 0.3, 0.3}, .twoSided = true}},
                  {{-1.3, 0.2, 0}, {0, 0, -0.5}, {0, 0.5, 0}, light(5, 5, 5)}};
  w.eye = {2, 0.5, 3};
  const SceneSnapshot scene = sceneOf(elementsOf(w));
  const auto found = [&](const char* visibility, uint64_t seed) {
    return estimates(scene, "ims", {{"walks", "1024"}, {"radius", "0.5"}, {"visibility", visibility}},
                     {.sets = 12, .seed = seed});
  };
  const Difference d = differenceOf(found("none", 1), found("exact", 2), static_cast<size_t>(Layer::mediaToMedia));
  fmt::print("without visibility: {:+.1f} %, p {:.2g}\n", 100 * d.relative, d.p);
  EXPECT_LT(d.p, kDisagree);
  EXPECT_GT(d.relative, 0.1);
}

// --- recursion ends ---

// Dense fog that absorbs nothing, a radius of many mean free paths and many new vertices at every level.
TEST(ImsRecursion, EndsWithManyVertices) {
  World w = denseFog();
  w.size = 4;
  w.maxDepth = -1;
  w.regions[0].medium.albedo = w.regions[1].medium.albedo = {1, 1, 1};
  w.regions[0].medium.sigmaT = 4;
  const SceneSnapshot scene = sceneOf(elementsOf(w));
  const RenderSession session = rendered(
      scene, {.passes = 1,
              .method = "ims",
              .settings = {{"walks", "64"}, {"radius", "2"}, {"compensation", "sampled"}, {"v1", "8"}, {"v2", "4"}}});
  EXPECT_EQ(session.film().nonFiniteSamples(), 0u);
}

}  // namespace
}  // namespace virga
