// SPDX-License-Identifier: Apache-2.0
// Sets of walks: in which order they lie, what they depend on, and in which media they begin.
#include "transport/virtual_lights.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <filesystem>

#include "image/scratch.h"
#include "scene/scenes.h"
#include "stats/stats.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using test::build;

/// Fog, walls of which some are glossy, a glass ball, lamps of several kinds.
std::string mixedRoom() {
  const auto wall = [](const char* turn, const char* bsdf) {
    return fmt::format(
        R"(<shape type="rectangle"><transform name="to_world"><translate z="-1"/>{}</transform>{}</shape>)", turn,
        bsdf);
  };
  return wall("", R"(<bsdf type="diffuse"/>)") +
         wall(R"(<rotate x="1" angle="-90"/>)", R"(<bsdf type="phong"><float name="exponent" value="8"/></bsdf>)") +
         wall(R"(<rotate y="1" angle="90"/>)",
              R"(<bsdf type="roughconductor"><float name="alpha" value="0.5"/></bsdf>)") +
         R"(<shape type="sphere"><float name="radius" value="0.3"/><bsdf type="dielectric"/></shape>
    <shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><rgb name="sigma_t" value="0.5, 1, 2"/>
      <float name="albedo" value="0.9"/></medium></shape>
    <emitter type="point"><point name="position" x="0.5" y="0.5" z="0.5"/></emitter>
    <emitter type="constant"><rgb name="radiance" value="0.2"/></emitter>
    <shape type="sphere"><point name="center" x="-0.5" y="0.6" z="0.2"/><float name="radius" value="0.1"/>
      <emitter type="area"/></shape>)";
}

bool same(const LightVertex& a, const LightVertex& b) {
  return a.kind == b.kind && a.p == b.p && a.wi == b.wi && a.weight == b.weight && a.medium == b.medium &&
         a.depth == b.depth && a.surface == b.surface && a.normal == b.normal;
}
/// Walk w of both sets, without regard to where their surfaces are kept.
bool sameWalk(const VirtualLights& a, const VirtualLights& b, int walk, int depth = 1 << 20) {
  const auto of = [&](const VirtualLights& all) {
    std::vector<LightVertex> list;
    for (size_t i = all.firstOf[static_cast<size_t>(walk)]; i < all.firstOf[static_cast<size_t>(walk) + 1]; ++i) {
      LightVertex v = all.lights[i];
      if (v.surface >= 0) v.surface = 0;
      if (v.depth <= depth) list.push_back(v);
    }
    return list;
  };
  const auto listA = of(a), listB = of(b);
  return std::equal(listA.begin(), listA.end(), listB.begin(), listB.end(), same);
}

const SampleId kId{5, 1, 0, 3};

TEST(VirtualLights, WalksLieOneAfterTheOther) {
  const SceneSnapshot scene = build(mixedRoom());
  for (const int walks : {1, 63, 64, 65, 1000}) {
    const VirtualLights all = traceVirtualLights(*scene, {.walks = walks}, kId);
    ASSERT_EQ(all.walks(), walks);
    EXPECT_EQ(all.firstOf.front(), 0u);
    EXPECT_EQ(all.firstOf.back(), all.lights.size());
    std::vector<int> uses(all.surfaces.size(), 0);
    for (size_t w = 0; w + 1 < all.firstOf.size(); ++w) {
      ASSERT_LE(all.firstOf[w], all.firstOf[w + 1]);
      for (size_t i = all.firstOf[w]; i < all.firstOf[w + 1]; ++i) {
        const LightVertex& v = all.lights[i];
        EXPECT_GT(v.depth, i > all.firstOf[w] ? all.lights[i - 1].depth : 0);
        EXPECT_NEAR(length(v.wi), 1, 1e-5f);
        EXPECT_TRUE(std::isfinite(maxComponent(v.weight)) && maxComponent(v.weight) > 0);
        EXPECT_EQ(v.kind == VertexKind::medium, v.medium >= 0);
        EXPECT_EQ(v.kind == VertexKind::surface, lengthSquared(v.normal) > 0);
        EXPECT_TRUE(v.kind == VertexKind::medium || dot(v.normal, v.wi) > 0);
        if (v.surface >= 0) ++uses[static_cast<size_t>(v.surface)];
      }
    }
    for (const int n : uses) EXPECT_EQ(n, 1) << "each kept surface is of one light";
  }
}

TEST(VirtualLights, DoNotDependOnTheNumberOfThreads) {
  const SceneSnapshot scene = build(mixedRoom());
  const auto with = [&](size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return traceVirtualLights(*scene, {.walks = 2000}, kId);
  };
  const VirtualLights one = with(1), four = with(4);
  EXPECT_EQ(one.firstOf, four.firstOf);
  ASSERT_EQ(one.lights.size(), four.lights.size());
  for (size_t i = 0; i < one.lights.size(); ++i) ASSERT_TRUE(same(one.lights[i], four.lights[i])) << i;
}

TEST(VirtualLights, AWalkIsTheSameInSetsOfAnySize) {
  const SceneSnapshot scene = build(mixedRoom());
  const VirtualLights few = traceVirtualLights(*scene, {.walks = 100}, kId);
  const VirtualLights many = traceVirtualLights(*scene, {.walks = 777}, kId);
  for (int w = 0; w < 100; ++w) EXPECT_TRUE(sameWalk(few, many, w)) << w;
}

TEST(VirtualLights, OtherSeedsReplicatesAndPassesAreOtherWalks) {
  const SceneSnapshot scene = build(mixedRoom());
  const VirtualLights all = traceVirtualLights(*scene, {.walks = 100}, kId);
  for (const SampleId& id : {SampleId{6, 1, 0, 3}, SampleId{5, 2, 0, 3}, SampleId{5, 1, 0, 4}}) {
    const VirtualLights other = traceVirtualLights(*scene, {.walks = 100}, id);
    int equal = 0;
    for (int w = 0; w < 100; ++w)
      equal += sameWalk(all, other, w) && all.firstOf[static_cast<size_t>(w)] < all.firstOf[static_cast<size_t>(w) + 1];
    EXPECT_EQ(equal, 0);
  }
}

TEST(VirtualLights, ALimitOfDepthCutsWalksAndChangesNothingElse) {
  const SceneSnapshot scene = build(mixedRoom());
  const VirtualLights all = traceVirtualLights(*scene, {.walks = 500}, kId);
  for (const int depth : {0, 1, 2, 5}) {
    const VirtualLights cut = traceVirtualLights(*scene, {.walks = 500, .maxDepth = depth}, kId);
    int deepest = 0;
    for (const LightVertex& v : cut.lights) deepest = std::max(deepest, v.depth);
    EXPECT_EQ(deepest, depth);
    for (int w = 0; w < 500; ++w) EXPECT_TRUE(sameWalk(all, cut, w, depth)) << depth << " " << w;
  }
}

// --- where there is nothing to walk ---

TEST(VirtualLights, NoLightsNoWalks) {
  for (const char* lights : {"", R"(<emitter type="point"><rgb name="intensity" value="0"/></emitter>)"}) {
    const SceneSnapshot scene = build(std::string(R"(<shape type="sphere"/>)") + lights);
    const VirtualLights all = traceVirtualLights(*scene, {.walks = 100}, kId);
    EXPECT_EQ(all.walks(), 100);
    EXPECT_TRUE(all.lights.empty());
  }
}

TEST(VirtualLights, ABlackSceneKeepsNone) {
  const SceneSnapshot scene = build(
      R"(<shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape>
      <shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous"><float name="albedo" value="0"/></medium></shape>
      <emitter type="constant"/>)");
  EXPECT_TRUE(traceVirtualLights(*scene, {.walks = 500}, kId).lights.empty());
}

TEST(VirtualLights, AnEmptySceneKeepsNone) {
  const SceneSnapshot scene = build(R"(<emitter type="constant"/><emitter type="point"/>)");
  EXPECT_TRUE(traceVirtualLights(*scene, {.walks = 500}, kId).lights.empty());
}

// --- media around the lights ---

/// A camera in fog without end.
std::string endless(const std::string& elements, const char* sigmaT) {
  return elements +
         fmt::format(
             R"(<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="{}"/><float name="albedo" value="0.8"/></medium>
    <sensor type="perspective" id="camera"><transform name="to_world"><lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/>
    </transform><ref name="medium" id="fog"/></sensor>)",
             sigmaT);
}
SceneSnapshot endlessScene(const std::string& elements, const char* sigmaT = "0.5, 0.5, 0.5") {
  return buildScene(test::describe(endless(elements, sigmaT)));
}

constexpr const char* kPoint = R"(<emitter type="point"/>)";

/// Mean extinction where walks leave the scene's first light.
float extinctionAtStart(const Scene& scene) {
  const WalkStarts starts(scene);
  Sampler sampler(kId);
  const WalkStarts::Start start = starts.sample(sampler);
  EXPECT_FALSE(isBlack(start.flux));
  float sum = 0;
  for (int i = 0; i < start.at.media.count(); ++i) sum += scene.view.media[start.at.media.medium(i)].sigmaT;
  return sum;
}

TEST(WalkStarts, FogWithoutEndIsAroundLights) {
  EXPECT_FLOAT_EQ(extinctionAtStart(*endlessScene(kPoint)), 0.5f);
  EXPECT_FLOAT_EQ(extinctionAtStart(*build(kPoint)), 0);
}
// Coefficients add, as they do on the way from the camera.
TEST(WalkStarts, FogWithoutEndIsInsideOfCloudsToo) {
  const std::string cloud = R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous">
    <float name="sigma_t" value="2"/></medium></shape>)";
  EXPECT_FLOAT_EQ(extinctionAtStart(*endlessScene(kPoint + cloud)), 2.5f);
  EXPECT_FLOAT_EQ(extinctionAtStart(*build(kPoint + cloud)), 2);
}
TEST(WalkStarts, WhatReplacesHasNoFogInside) {
  const auto glass = [](const char* inside) {
    return fmt::format(R"(<shape type="sphere"><bsdf type="dielectric"/>{}<ref name="exterior" id="fog"/></shape>)",
                       inside);
  };
  EXPECT_FLOAT_EQ(extinctionAtStart(*endlessScene(kPoint + glass(R"(<medium name="interior" type="homogeneous">
    <float name="sigma_t" value="3"/></medium>)"))),
                  3);
  EXPECT_FLOAT_EQ(extinctionAtStart(*endlessScene(kPoint + glass(""))), 0) << "vacuum";
}
TEST(WalkStarts, OfLightsInACloudThatTheCameraDeclaresAgain) {
  const std::string cloud =
      R"(<shape type="sphere"><float name="radius" value="20"/><bsdf type="null"/><ref name="interior" id="fog"/>
    </shape>)";
  EXPECT_FLOAT_EQ(extinctionAtStart(*endlessScene(kPoint + cloud)), 0.5f);
}

constexpr const char* kSky = R"(<emitter type="constant"/>)";
constexpr const char* kSun = R"(<emitter type="directional"/>)";

TEST(WalkStarts, LightFromInfinityDoesNotGetThroughFogWithoutEnd) {
  for (const char* light : {kSky, kSun}) {
    const SceneSnapshot scene = endlessScene(std::string(R"(<shape type="sphere"/>)") + light);
    EXPECT_TRUE(traceVirtualLights(*scene, {.walks = 500}, kId).lights.empty()) << light;
    const SceneSnapshot clear = build(std::string(R"(<shape type="sphere"/>)") + light);
    EXPECT_FALSE(traceVirtualLights(*clear, {.walks = 500}, kId).lights.empty()) << light;
  }
}
// What surfaces get at first is drawn by the same numbers with fog and without.
TEST(WalkStarts, LightFromInfinityGetsThroughWhereFogIsClear) {
  struct Case {
    const char* sigmaT;
    Rgb through;
  };
  for (const Case& c : {Case{"0, 0, 0", {1, 1, 1}}, {"0.5, 0.5, 0", {0, 0, 1}}, {"0, 2, 0", {1, 0, 1}}})
    for (const char* light : {kSky, kSun}) {
      const std::string elements = std::string(R"(<shape type="sphere"/>)") + light;
      const WalkOptions once{.walks = 200, .maxDepth = 1};
      const VirtualLights clear = traceVirtualLights(*build(elements), once, kId);
      const VirtualLights foggy = traceVirtualLights(*endlessScene(elements, c.sigmaT), once, kId);
      ASSERT_EQ(foggy.lights.size(), clear.lights.size()) << c.sigmaT;
      ASSERT_GT(clear.lights.size(), 50u);
      for (size_t i = 0; i < clear.lights.size(); ++i) {
        EXPECT_EQ(foggy.lights[i].p, clear.lights[i].p);
        const Rgb expected = clear.lights[i].weight * c.through;
        for (int ch = 0; ch < 3; ++ch)
          EXPECT_NEAR(foggy.lights[i].weight[ch], expected[ch], 1e-5f * maxComponent(expected)) << c.sigmaT;
      }
    }
}

/// A camera that declares a grid of ones in a cube around 0, in [-2, 2]^3.
SceneSnapshot gridScene(const std::string& elements, double sigmaT, double edge = 4) {
  const std::filesystem::path file = scratchFile("ones.vol");
  writeVol(file, {2, 2, 2, std::vector<float>(8, 1.f), {}});
  return buildScene(test::describe(
      elements + fmt::format(R"(<medium type="heterogeneous" id="grid"><volume name="sigma_t" type="gridvolume">
      <string name="filename" value="{}"/><transform name="to_world"><translate value="-0.5"/><scale value="{}"/></transform>
      </volume><float name="albedo" value="1"/><float name="scale" value="{}"/></medium>
    <sensor type="perspective" id="camera"><transform name="to_world"><lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/>
    </transform><ref name="medium" id="grid"/></sensor>)",
                             file.string(), edge, sigmaT)));
}

// The shape, if there is one, is smaller than the grid: light is lost if walks start at shapes alone.
TEST(WalkStarts, LightFromInfinityMeetsAllOfAGridWithoutEnd) {
  const std::string block =
      R"(<shape type="sphere"><float name="radius" value="0.05"/><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape>)";
  for (const std::string& shapes : {std::string(), block})
    for (const double sigmaT : {0.1, 1.0}) {
      const SceneSnapshot scene = gridScene(shapes + kSun, sigmaT);
      stats::Moments scattered, far;
      for (uint32_t set = 0; set < 60; ++set) {
        const VirtualLights all = traceVirtualLights(*scene, {.walks = 2000, .maxDepth = 1}, {7, set, 0, 0});
        double sum = 0, behind = 0;
        for (const LightVertex& v : all.lights) (v.p.z < 0 ? behind : sum) += static_cast<double>(v.weight.g) / 2000;
        scattered.add(sum + behind), far.add(behind);
      }
      // Irradiance 1 along z on a square of 16, and an optical thickness of 2 sigma_t before the half that is behind.
      const double most = 16 * (1 - std::exp(-4 * sigmaT)), half = 16 * (1 - std::exp(-2 * sigmaT));
      EXPECT_NEAR(scattered.mean(), most, 4 * scattered.standardError() + 1e-3 * most) << sigmaT;
      EXPECT_NEAR(far.mean(), half, 4 * far.standardError() + 2e-3 * most) << sigmaT;
      EXPECT_LT(scattered.standardError(), 0.02 * most);
    }
}
TEST(WalkStarts, ServeScenesThatLightFromInfinityMeetsAlike) {
  const auto serve = [](const SceneSnapshot& before, const SceneSnapshot& next) {
    return WalkStarts(*before).serve(WalkStarts(*next));
  };
  const std::string ball = R"(<shape type="sphere"/>)";
  const SceneSnapshot thin = endlessScene(ball + kSky, "0.1, 0.1, 0.1"), thick = endlessScene(ball + kSky, "3, 2, 1"),
                      clear = endlessScene(ball + kSky, "0, 0, 0"), blue = endlessScene(ball + kSky, "3, 2, 0");
  EXPECT_TRUE(serve(thin, thick) && serve(thick, thin));
  EXPECT_FALSE(serve(thin, clear) || serve(clear, thin) || serve(blue, thick));
  EXPECT_TRUE(serve(endlessScene(ball + kPoint, "3, 2, 0"), endlessScene(ball + kPoint, "3, 2, 1")));
  const SceneSnapshot large = gridScene(ball + kSky, 1, 6), small = gridScene(ball + kSky, 2, 5);
  EXPECT_TRUE(serve(large, small));
  EXPECT_FALSE(serve(small, large)) << "walks would not meet all of it";
}

// A lamp that lies on the boundary of fog shines into it: what it emits inward meets all of the fog.
TEST(WalkStarts, LampsOnABoundary) {
  const std::string fog =
      R"(<shape type="cube"><transform name="to_world"><scale value="10"/></transform><bsdf type="null"/>
    <medium name="interior" type="homogeneous"><float name="sigma_t" value="1"/><float name="albedo" value="0.5"/></medium></shape>)";
  const auto lamp = [](const char* turn) {
    return fmt::format(
        R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="{}"/><translate z="10"/></transform>
      <emitter type="area"/></shape>)",
        turn);
  };
  const auto first = [&](const char* turn) {
    const VirtualLights all = traceVirtualLights(*build(fog + lamp(turn)), {.walks = 4000, .maxDepth = 1}, kId);
    stats::Moments depths;
    for (const LightVertex& v : all.lights) depths.add(std::exp(-(10 - static_cast<double>(v.p.z))));
    return depths;
  };
  const stats::Moments inward = first("180");
  EXPECT_EQ(inward.count(), 4000);
  // The depth z of the first collision: E exp(-z) over the cosine's distribution is the integral of 2 c / (1 + c).
  EXPECT_NEAR(inward.mean(), 2 * (1 - std::log(2.)), 4 * inward.standardError());
  EXPECT_EQ(first("0").count(), 0) << "it shines away";
}

}  // namespace
}  // namespace virga
