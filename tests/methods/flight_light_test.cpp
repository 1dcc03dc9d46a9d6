// SPDX-License-Identifier: Apache-2.0
// Light of lamps with tables, gathered along free flights: look-ups against exact transmittances, and pictures layer by
// layer against those of shadow rays.
#include "methods/path/flight_light.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "methods/ims_scenes.h"
#include "methods/layer_means.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr int64_t kManyPixels = 1 << 20;

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string point(const char* place, double intensity) {
  return fmt::format(R"(<emitter type="point"><point name="position" {}/><rgb name="intensity" value="{}"/></emitter>)",
                     place, intensity);
}
/// Keeps some of the lamp's light from the plume.
const std::string kScreen = R"(<shape type="rectangle"><transform name="to_world"><scale x="0.4" y="0.25"/>
  <rotate x="1" angle="-60"/><translate x="-0.9" y="1.3" z="0.5"/></transform>
  <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>)";
const std::string kSpot = R"(<emitter type="spot"><transform name="to_world">
  <lookat origin="3, 0.5, 1" target="0, 0, 0" up="0, 1, 0"/></transform>
  <float name="cutoff_angle" value="40"/><rgb name="intensity" value="30, 20, 10"/></emitter>)";
const std::string kAreaLamp = R"(<shape type="sphere"><point name="center" x="1.5" y="1.5" z="-1"/>
  <float name="radius" value="0.2"/><emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>)";
const std::string kSky = R"(<emitter type="constant"><rgb name="radiance" value="0.005, 0.01, 0.015"/></emitter>)";
/// A ball of fire over the plume's cube, so that media overlap.
std::string overlapping(int size) {
  const std::string text = plume(size),
                    begin = R"(<shape type="cube"><transform name="to_world"><scale value="0.95"/>)";
  const std::string smoke = text.substr(text.find(begin));
  return text + replaced(smoke, R"(<scale value="0.95"/>)", R"(<scale value="0.5"/><translate x="0.2" y="-0.6"/>)");
}

// --- look-ups ---

struct LookUp {
  Vec3 x;
  float exact, found;
  stats::Moments estimates;
};
/// At points in and around the plume, with tables of so many nodes.
std::vector<LookUp> lookUps(const Scene& scene, int side, float checks) {
  const LampTables tables(scene, side, {});
  const TabledLamp lamp{tables.view()[0], checks, true};
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  std::vector<LookUp> result;
  Pcg32 random(3);
  for (int n = 0; n < 40; ++n) {
    const Vec3 x = Vec3(random.next(), random.next(), random.next()) * 1.8f - Vec3(0.9f, 0.9f, 0.9f);
    const float d = distance(x, lamp.table.p);
    const MediaRay r{{x, (lamp.table.p - x) / d}, mediaAt(scene, x), 0};
    const ConnectingRay ray = aimAt(scene.view, r, lamp.table.p);
    LookUp here{x, std::exp(-opticalDepth(scene.view, rays, r, d).r), std::exp(-lamp.table.depthTo(x).r), {}};
    for (int i = 0; i < 4000; ++i) {
      const float weight = i % 3 == 0 ? 1.f : 0.2f;
      here.estimates.add(static_cast<double>(estimateTransmittance(scene.view, rays, lamp, x, ray, weight, random)));
    }
    result.push_back(here);
  }
  return result;
}

TEST(TabledLamps, ChecksMakeLookUpsUnbiased) {
  const SceneSnapshot scene = sceneOf(plume(8));
  double worst = 1;
  int wrong = 0;
  for (const LookUp& here : lookUps(*scene, 12, 0.2f)) {
    if (std::fabs(here.found - here.exact) > 0.02f) ++wrong;
    if (std::fabs(here.found - here.exact) < 1e-6f) continue;
    worst = std::min(worst, stats::oneSampleTest(here.estimates, static_cast<double>(here.exact)));
  }
  EXPECT_GT(wrong, 5) << "this table is off in many places";
  EXPECT_GT(40 * worst, 1e-3);
}

TEST(TabledLamps, WorseTablesAreCheckedMoreOftenAndTheWorstAreNotUsed) {
  const SceneSnapshot scene = sceneOf(plume(8));
  const auto checks = [&](int side) {
    const TabledLamps lamps(*scene, side, {});
    return lamps.view().size > 0 && lamps.view()[0].present() ? lamps.view()[0].checks : 1.f;
  };
  const float usual = checks(tabledLampSide(*scene, kManyPixels));
  EXPECT_LT(usual, 0.08f);
  EXPECT_GT(checks(24), 1.5f * usual);
  EXPECT_EQ(checks(2), 1) << "no table";
}

TEST(TabledLamps, KnowWhereSurfacesMayBeInTheWay) {
  const auto clear = [](const std::string& elements) {
    const SceneSnapshot scene = sceneOf(elements);
    const TabledLamps lamps(*scene, 72, {});
    EXPECT_TRUE(lamps.view().size > 0 && lamps.view()[0].present());
    return lamps.view().size > 0 && lamps.view()[0].clear;
  };
  // The block of the plume's scene lies beside it, but not beside the box around plume and lamp.
  const std::string block =
      R"(<shape type="cube"><transform name="to_world"><scale value="0.3"/><translate x="1.2" y="-0.7" z="0.6"/></transform></shape>)";
  const std::string open = replaced(plume(8), block, "");
  EXPECT_TRUE(clear(open));
  EXPECT_FALSE(clear(open + kScreen));
  EXPECT_FALSE(clear(
      open +
      R"(<shape type="sphere"><point name="center" x="-1" y="1" z="0.5"/><float name="radius" value="0.1"/></shape>)"));
}

TEST(TabledLamps, AreNotWhereTheyCannotBe) {
  const auto side = [](const std::string& elements) {
    const SceneSnapshot scene = sceneOf(elements);
    EXPECT_EQ(TabledLamps(*scene, 40, {}).view().size, 0);
    EXPECT_EQ(TabledLamps(*scene, 0, {}).view().size, 0);
    return tabledLampSide(*scene, kManyPixels);
  };
  EXPECT_EQ(side(fog(8) + point(R"(x="0" y="0" z="0")", 1)), 0);
  EXPECT_EQ(side(replaced(plume(8), R"(<float name="scale" value="12"/>)", R"(<rgb name="scale" value="12, 4, 8"/>)")),
            0);
}

TEST(TabledLamps, AreSmallBesideThePicture) {
  const SceneSnapshot scene = sceneOf(plume(8));
  EXPECT_LE(lampTableBytes(scene->view, tabledLampSide(*scene, 100)), size_t{100 * 64 * 4});
  EXPECT_GT(tabledLampSide(*scene, kManyPixels), 2 * tabledLampSide(*scene, 100));
  EXPECT_LE(lampTableBytes(scene->view, tabledLampSide(*scene, kManyPixels)), size_t{16} << 20);
}

// --- pictures ---

LayerMeans pictures(const SceneSnapshot& scene, const char* table, uint64_t seed, int passes) {
  return layerMeans(scene, {.passes = passes, .seed = seed, .settings = {{"lamp_table", table}}});
}

/// Tables as they are by default, and such as are much too coarse, against none.
void expectSamePictures(const std::string& elements, const std::string& denser) {
  constexpr int passes = 640;
  const SceneSnapshot scene = sceneOf(elements);
  const LayerMeans truth = pictures(scene, "0", 1, 2 * passes);
  expectSameLayers(truth, pictures(scene, "72", 11, passes), "gathered");
  expectSameLayers(truth, pictures(scene, "24", 21, passes), "by a coarse table");
  // What the test can tell.
  const LayerMeans other = pictures(sceneOf(denser), "72", 11, passes);
  EXPECT_LT(std::min(agreement(truth, other, Layer::mediaToMedia), agreement(truth, other, Layer::directMedia)), 1e-3);
}
std::string denser(const std::string& elements) {
  return replaced(elements, R"(<float name="scale" value="12"/>)", R"(<float name="scale" value="16"/>)");
}

TEST(FlightLight, EveryLayer) { expectSamePictures(plume(16), denser(plume(16))); }

TEST(FlightLight, EveryLayerWithManyLampsAndAScreen) {
  const std::string elements = plume(16) + kScreen + kSpot + kAreaLamp + kSky;
  expectSamePictures(elements, denser(elements));
}

TEST(FlightLight, EveryLayerOfShortPathsInSmokeThatOverlapsAndGlows) {
  const auto glowing = [](std::string text) {
    return R"(<integrator type="volpath"><integer name="max_depth" value="4"/></integrator>)" +
           replaced(std::move(text), R"(<float name="scale" value="12"/>)",
                    R"(<float name="scale" value="12"/><rgb name="emission" value="0.2, 0.1, 0.05"/>
                       <phase type="hg"><float name="g" value="0.6"/></phase>)");
  };
  expectSamePictures(glowing(overlapping(16)), denser(glowing(overlapping(16))));
}

double noise(const SceneSnapshot& scene, const SettingValues& settings) {
  return rendered(scene, {.passes = 64, .settings = {settings.begin(), settings.end()}})
      .film()
      .estimatedRelMse()
      .value();
}
TEST(FlightLight, LeavesLessNoise) {
  const SceneSnapshot scene = sceneOf(plume(24));
  EXPECT_LT(noise(scene, {{"lamp_table", "72"}}), 0.85 * noise(scene, {{"lamp_table", "0"}}));
}
// Deep inside of dense smoke a table is right without merit: it is dark there. What counts is its lit skin.
TEST(FlightLight, IsNotNoisierInDenseSmokeWithSharpEdges) {
  for (const char* scale : {"100", "400", "3000"}) {
    const SceneSnapshot scene = sceneOf(replaced(plume(24), R"(<float name="scale" value="12"/>)",
                                                 fmt::format(R"(<float name="scale" value="{}"/>)", scale)));
    EXPECT_LT(noise(scene, {}), 1.2 * noise(scene, {{"lamp_table", "0"}})) << scale;
  }
}

TEST(FlightLight, EveryLayerInSmokeAroundEverything) {
  constexpr int passes = 320;
  const SceneSnapshot scene = sceneOf(endlessPlume(16, 4) + kScreen);
  const LayerMeans truth = pictures(scene, "0", 1, 2 * passes);
  expectSameLayers(truth, pictures(scene, "72", 11, passes), "gathered");
  EXPECT_GT(truth.layers[static_cast<size_t>(Layer::directMedia)][LayerMeans::kWhole].mean(), 1e-3);
}
TEST(FlightLight, TablesFollowACameraThatLeavesASmallCloudOfItsMedium) {
  const SceneSnapshot inside = sceneOf(endlessPlume(16, 0.1)), outside = sceneOf(endlessPlume(16, 4));
  ASSERT_NE(endlessMedium(*inside), endlessMedium(*outside));
  RenderSession session(inside, findMethod("path"), {.settings = {.values = {}, .seed = 1}});
  session.step();
  session.edit(outside, {{{"camera", Aspect::camera}}});
  session.step();
  EXPECT_EQ(largestDifference(session.film().beauty(), rendered(outside, {.passes = 1}).film().beauty()), 0);
}

TEST(FlightLight, LampsWithoutPowerAreDark) {
  const std::string dark =
      replaced(plume(8), R"(<rgb name="intensity" value="50"/>)", R"(<rgb name="intensity" value="0"/>)");
  EXPECT_EQ(pixelMoments(rendered(sceneOf(dark)).film().beauty()).mean(), 0);
  const std::string both = plume(8) + point(R"(x="1" y="2" z="1")", 0);
  const auto tables = [](const std::string& elements) {
    return pixelMoments(rendered(sceneOf(elements), {.passes = 64}).film().beauty()).mean();
  };
  EXPECT_NEAR(tables(both) / tables(plume(8)), 1, 0.05) << "one that is dark beside one that is not";
}

TEST(FlightLight, TablesFollowTheLampNotTheCamera) {
  const std::string lamp = R"(<point name="position" x="-2.5" y="3" z="1.5"/>)";
  const SceneSnapshot first = sceneOf(plume(12)),
                      moved = sceneOf(replaced(plume(12), lamp, R"(<point name="position" x="2" y="2" z="1"/>)")),
                      seen = sceneOf(plume(12, 0.3f));
  const auto after = [&](const SceneSnapshot& next, const ChangeSet& changes) {
    RenderSession session(first, findMethod("path"), {.settings = {.values = {}, .seed = 1}});
    session.step();
    session.edit(next, changes);
    session.step();
    return session.film().beauty();
  };
  const auto fresh = [](const SceneSnapshot& scene) { return rendered(scene, {.passes = 1}).film().beauty(); };
  EXPECT_EQ(largestDifference(after(moved, {{{"lamp", Aspect::emitterPose}}}), fresh(moved)), 0);
  EXPECT_EQ(largestDifference(after(seen, {{{"camera", Aspect::camera}}}), fresh(seen)), 0);
}

TEST(FlightLight, SettingsThatMakeNoSenseAreRefused) {
  const auto messageOf = [](const std::string& elements, const char* nodes) -> std::string {
    try {
      return rendered(sceneOf(elements), {.passes = 1, .settings = {{"lamp_table", nodes}}})
          .method()
          .settingsInForce()
          .at("lamp_table");
    } catch (const Error& error) {
      return error.what();
    }
  };
  EXPECT_EQ(messageOf(plume(8), "40"), "40");
  EXPECT_EQ(messageOf(plume(8), "2"), "0") << "a table that is of no use";
  EXPECT_EQ(messageOf(fog(8), "40"), "0") << "there are no grids";
  EXPECT_TRUE(messageOf(plume(8), "1").starts_with("error: --set path.lamp_table may be 2 to 512, or 0"));
}

}  // namespace
}  // namespace virga
