// SPDX-License-Identifier: Apache-2.0
// Tables of what media let through from lamps, and the marching of `ims.mode=fast`: against exact optical depths, and
// pixel by pixel against `path`.
#include "transport/lamp_tables.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/random.h"
#include "image/scratch.h"
#include "loaders/mitsuba_xml.h"
#include "methods/ims_scenes.h"
#include "methods/rendering.h"
#include "scene/builder.h"
#include "transport/media_walk.h"
#include "transport/optical_depth.h"
#include "transport/virtual_lights.h"
#include "volume/volume_io.h"

namespace virga {
namespace {

using namespace virga::testing;

/// Exact, from a lamp at p to x.
Rgb transmittanceBetween(const Scene& scene, Vec3 p, Vec3 x) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const float d = distance(p, x);
  MediaRay r{{p, (x - p) / d}, mediaAt(scene, p, endlessMedium(scene)), 0};
  Rgb depth;
  walkMedia(scene.view, rays, r, d, [&](float t0, float t1) {
    for (int i = 0; i < r.media.count(); ++i) depth += opticalDepth(scene.view.media[r.media.medium(i)], r.ray, t0, t1);
    return true;
  });
  return exp(depth * -1);
}

struct Errors {
  double rms[3] = {}, mean[3] = {};
  double darkest = 1;  ///< least transmittance that was met
};
/// Of the first emitter's table, at points in and around the plume's cube.
Errors errorsOf(const Scene& scene, int side) {
  const LampTables tables(scene, side, {});
  Errors errors;
  if (tables.view().size == 0 || !tables.view()[0].present()) return {{1, 1, 1}, {1, 1, 1}, 1};
  const LampTable& table = tables.view()[0];
  constexpr int kPoints = 2000;
  Pcg32 random(5);
  for (int n = 0; n < kPoints; ++n) {
    const Vec3 x = Vec3(random.next(), random.next(), random.next()) * 3 - Vec3(1.5f, 1.5f, 1.5f);
    const Rgb truth = transmittanceBetween(scene, table.p, x), found = exp(table.depthTo(x) * -1);
    for (int c = 0; c < 3; ++c) {
      const auto off = static_cast<double>(found[c] - truth[c]);
      errors.rms[c] += off * off / kPoints;
      errors.mean[c] += off / kPoints;
      errors.darkest = std::min(errors.darkest, static_cast<double>(truth[c]));
    }
  }
  for (double& r : errors.rms) r = std::sqrt(r);
  return errors;
}

/// `coarser`: by so much a table is too coarse.
void expectTables(const std::string& elements, double limit = 0.015, int coarser = 16) {
  const SceneSnapshot scene = sceneOf(elements);
  const int side = lampTableSide(*scene);
  ASSERT_GT(side, 0);
  const Errors fine = errorsOf(*scene, side), coarse = errorsOf(*scene, side / coarser);
  ASSERT_LT(fine.darkest, 0.5) << "there is something to be in the shadow of";
  for (int c = 0; c < 3; ++c) {
    EXPECT_LT(fine.rms[c], limit) << c;
    EXPECT_LT(std::fabs(fine.mean[c]), 0.002) << c;
    EXPECT_GT(coarse.rms[c], 0.06) << "a table that is much too coarse must be seen";
  }
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}
const std::string kLamp = R"(<point name="position" x="-2.5" y="3" z="1.5"/>)";
std::string withLampAt(const std::string& place) {
  return replaced(plume(8), kLamp, "<point name=\"position\" " + place + "/>");
}
/// The plume's smoke, and the same once more in a smaller cube that reaches out of the first.
std::string overlapping() {
  const std::string text = plume(8), begin = R"(<shape type="cube"><transform name="to_world"><scale value="0.95"/>)";
  const std::string smoke = text.substr(text.find(begin));
  return text + replaced(smoke, R"(<scale value="0.95"/>)", R"(<scale value="0.5"/><translate x="0.2" y="-0.6"/>)");
}
/// The plume's smoke once more, beside it.
std::string twice(double apart) {
  const std::string text = plume(8), begin = R"(<shape type="cube"><transform name="to_world"><scale value="0.95"/>)",
                    place = R"(<translate x="-1" y="-1" z="-1"/>)";
  const std::string smoke = text.substr(text.find(begin)), there = fmt::format(R"(<translate x="{}"/>)", apart);
  return text + replaced(replaced(smoke, begin, begin + there), place, place + there);
}

TEST(LampTables, ALampOutsideLooksIntoASquareOfDirections) { expectTables(plume(8)); }
TEST(LampTables, ALampInTheMediumLooksAllAround) { expectTables(withLampAt(R"(x="0.1" y="-0.4" z="0.05")")); }
TEST(LampTables, ALampBesideTheMediumLooksAllAround) { expectTables(withLampAt(R"(x="0.2" y="1.2" z="-0.3")")); }
TEST(LampTables, MediaThatOverlap) { expectTables(overlapping()); }
// The plume's foot is cut off by the grid.
TEST(LampTables, AGridLargerThanAllShapes) { expectTables(endlessPlume(8, 4), 0.02); }
TEST(LampTables, GridsThatLieApart) { expectTables(twice(5)); }
// Where they are too small beside what lies between them fast marches, and path checks its tables.
TEST(LampTables, GridsThatLieFarApart) {
  const SceneSnapshot scene = sceneOf(twice(20));
  EXPECT_GT(wantedLampTableSide(*scene), 512);
  EXPECT_EQ(lampTableSide(*scene), 0);
  EXPECT_GT(errorsOf(*scene, 72).rms[0], 0.03) << "a table for one of them alone";
}
TEST(LampTables, Colours) {
  const std::string scale = R"(<float name="scale" value="12"/>)";
  expectTables(replaced(plume(8), scale, R"(<rgb name="scale" value="12, 4, 8"/>)"));
}

// --- coarse grids ---

/// A grid of 32^3 voxels, given by value(place in [-1, 1]^3), on that cube, and a lamp.
template <class Value>
std::string coarseGrid(const std::string& file, Vec3 lamp, Value&& value) {
  constexpr int n = 32;
  DenseVolume volume{n, n, n, {}, {}};
  const auto place = [](int i) { return 2 * static_cast<float>(i) / (n - 1) - 1; };
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) volume.values.push_back(value(Vec3(place(i), place(j), place(k))));
  const std::filesystem::path path = scratchFile(file);
  writeVol(path, volume);
  return fmt::format(R"(<sensor type="perspective"/><emitter type="point"><point name="position" value="{}, {}, {}"/>
    </emitter><shape type="cube"><bsdf type="null"/><medium name="interior" type="heterogeneous">
    <volume name="sigma_t" type="gridvolume"><string name="filename" value="{}"/>
    <transform name="to_world"><scale value="2"/><translate value="-1"/></transform></volume>
    <float name="scale" value="3"/></medium></shape>)",
                     lamp.x, lamp.y, lamp.z, path.string());
}

/// By how much the table's light in a part of the medium is too bright, as a share.
double biasOf(const Scene& scene, const Bounds& part, int side) {
  const LampTables tables(scene, side, {});
  const LampTable& table = tables.view()[0];
  Pcg32 random(7);
  double found = 0, truth = 0;
  for (int n = 0; n < 20000; ++n) {
    const Vec3 x = part.lo + Vec3(random.next(), random.next(), random.next()) * part.extent();
    const float light = scene.view.media[0].sigmaTAt(x).r;
    found += static_cast<double>(light * std::exp(-table.depthTo(x).r));
    truth += static_cast<double>(light * transmittanceBetween(scene, table.p, x).r);
  }
  return found / truth - 1;
}
void expectSmallBias(const std::string& elements, const Bounds& part) {
  const SceneSnapshot scene = sceneOf(elements);
  EXPECT_LT(std::fabs(biasOf(*scene, part, lampTableSide(*scene))), 0.007);
  EXPECT_GT(std::fabs(biasOf(*scene, part, 48)), 0.03) << "one and a half nodes a voxel, and fewer radii";
}

TEST(LampTables, TheSharpEdgeOfACoarseBall) {
  expectSmallBias(coarseGrid("ball.vol", {0, 6, 4}, [](Vec3 p) { return length(p) < 0.8f ? 3.f : 0.f; }),
                  {{-1, -1, -1}, {1, 1, 1}});
}
TEST(LampTables, VoxelsThatDifferBeforeALampAtTheirCorner) {
  Pcg32 random(3);
  expectSmallBias(coarseGrid("lumpy.vol", {1, 1.1f, 1}, [&](Vec3) { return random.next() < 0.85f ? 0.f : 2.f; }),
                  {{-1, -1, -1}, {0, 0, 0}});
}

TEST(LampTables, WhereTheyCannotBeThereAreNone) {
  const std::string point = R"(<emitter type="point"/>)", sun = R"(<emitter type="directional"/>)";
  const std::string sphere = R"(<shape type="sphere"><emitter type="area"/></shape>)";
  const std::string lamp = R"(<emitter type="point">)" + kLamp + R"(<rgb name="intensity" value="50"/></emitter>)";
  std::string many = plume(8);
  for (int i = 0; i < LampTables::kMostLamps; ++i) many += point;
  for (const std::string& elements : {fog(8) + point, replaced(plume(8), lamp, sun + sphere), many}) {
    const SceneSnapshot scene = sceneOf(elements);
    EXPECT_EQ(lampTableSide(*scene), 0);
    EXPECT_EQ(LampTables(*scene, 16, {}).view().size, 0);
  }
  const SceneSnapshot mixed = sceneOf(plume(8) + sphere + sun);
  const LampTables tables(*mixed, 16, {});
  ASSERT_EQ(tables.view().size, mixed->view.emitters.size);
  for (int i = 0; i < tables.view().size; ++i)
    EXPECT_EQ(tables.view()[i].present(), mixed->view.emitters[i].kind == EmitterView::Kind::point);
}

// --- the picture ---

RenderSession direct(const SceneSnapshot& scene, const std::string& method, int passes, SettingValues settings) {
  settings.insert({"max_depth", "2"});
  return rendered(scene, {.passes = passes, .layers = LayerMask::all(), .method = method, .settings = settings});
}

/// Sum over pixels of (a - b)^2, less what noise adds, over that of b^2.
double systematicError(const Film& a, const Film& b, Layer layer) {
  const Image x = a.layer(layer), y = b.layer(layer), vx = a.layerVariance(layer), vy = b.layerVariance(layer);
  double sum = 0, all = 0;
  for (size_t i = 0; i < x.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const double own = x.pixels[i][c], truth = y.pixels[i][c];
      const double noise = static_cast<double>(vx.pixels[i][c]) + static_cast<double>(vy.pixels[i][c]);
      sum += (own - truth) * (own - truth) - noise;
      all += truth * truth;
    }
  return sum / all;
}

// Measured: media 3e-4 with tables and nothing marched, 0.16 with either much too coarse; surface 4e-6, 1e-3 and 5e-4.
TEST(FastMarching, DirectLightIsThatOfPathPixelByPixel) {
  const SceneSnapshot scene = sceneOf(plume(40));
  const Film truth = direct(scene, "path", 1200, {}).film();
  const auto expectError = [&](const SettingValues& settings, const auto& check) {
    SettingValues all = settings;
    all.insert({{"mode", "fast"}, {"walks", "1"}, {"samples", "1"}});
    const Film own = direct(scene, "ims", 120, all).film();
    for (const auto& [layer, limit] : {std::pair{Layer::directMedia, 1.5e-3}, {Layer::directSurface, 1e-4}})
      check(systematicError(own, truth, layer), limit);
  };
  for (const SettingValues& settings : {SettingValues{}, {{"lamp_table", "0"}}})
    expectError(settings, [](double error, double limit) { EXPECT_LT(error, limit); });
  for (const SettingValues& settings : {SettingValues{{"lamp_table", "8"}}, {{"eye_steps", "4"}}})
    expectError(settings, [](double error, double limit) { EXPECT_GT(error, 3 * limit) << "must be seen"; });
}

// Features are the same whichever pass comes first, and pass 0 lights as it does when it is alone.
TEST(FastMarching, PassesArePureFunctionsOfTheirIndex) {
  const SceneSnapshot scene = sceneOf(plume(24));
  const auto passes = [&](std::initializer_list<int> indices) {
    const auto method = findMethod("ims").create();
    method->prepare(scene, {.values = {{"mode", "fast"}, {"walks", "200"}}, .seed = 3}, LayerMask::none());
    Image last;
    for (const int index : indices) {
      Film film(24, 24, LayerMask::none());
      method->pass(index, {}, {}, film.frame());
      film.average(0);
      last = film.beauty();
    }
    return last;
  };
  EXPECT_EQ(largestDifference(passes({0, 1, 9}), passes({9})), 0);
  EXPECT_EQ(largestDifference(passes({9, 1, 0}), passes({0})), 0);
  EXPECT_GT(largestDifference(passes({0}), passes({9})), 0);
}

TEST(FastMarching, AnEditedSceneRendersAsIfItWereNew) {
  const std::string head = R"(<scene version="3.0.0">)", tail = "</scene>";
  SceneDescription current = parseMitsubaXml(
      head +
          replaced(replaced(plume(20), R"(<emitter type="point">)", R"(<emitter type="point" id="lamp">)"),
                   R"(<sensor type="perspective">)", R"(<sensor type="perspective" id="camera">)") +
          tail,
      "edit.xml", ".");
  const std::tuple<const char*, const char*, Value> edits[] = {
      {"camera", "to_world", Matrix4::lookAt({1, 1, 4}, {0, 0, 0}, {0, 1, 0})}, {"lamp", "position", Vec3(2, 2, 2)}};
  const Settings settings{.values = {{"mode", "fast"}, {"walks", "200"}}};
  SceneSnapshot snapshot = buildScene(current);
  RenderSession session(snapshot, findMethod("ims"), {.settings = settings});
  for (int i = 0; i < 2; ++i) session.step();
  for (const auto& [node, property, value] : edits) {
    const SceneDescription next = edited(current, node, property, value);
    snapshot = buildScene(next, {}, snapshot);
    session.edit(snapshot, differences(current, next));
    RenderSession fresh(buildScene(next), findMethod("ims"), {.settings = settings});
    for (int i = 0; i < 2; ++i) session.step(), fresh.step();
    EXPECT_EQ(largestDifference(session.film().beauty(), fresh.film().beauty()), 0) << node;
    current = next;
  }
}

TEST(FastMarching, SettingsThatMakeNoSenseAreRefused) {
  const SceneSnapshot scene = sceneOf(plume(8)), foggy = sceneOf(fog(8));
  const auto messageOf = [](const SceneSnapshot& of, const SettingValues& settings) -> std::string {
    try {
      RenderSession session(of, findMethod("ims"), {.settings = {.values = settings}});
      return session.method().settingsInForce().at("lamp_table");
    } catch (const Error& error) {
      return error.what();
    }
  };
  EXPECT_EQ(messageOf(scene, {{"mode", "fast"}}), "116") << "1.5 nodes a voxel where the grid ends";
  EXPECT_EQ(messageOf(scene, {{"mode", "fast"}, {"lamp_table", "40"}}), "40");
  EXPECT_EQ(messageOf(foggy, {{"mode", "fast"}, {"lamp_table", "40"}}), "0") << "fog is marched";
  const auto refused = [&](const SettingValues& settings, const char* message) {
    EXPECT_TRUE(messageOf(scene, settings).starts_with(message)) << messageOf(scene, settings);
  };
  refused({{"lamp_table", "40"}}, "error: --set ims.lamp_table needs ims.mode=fast");
  refused({{"eye_steps", "40"}}, "error: --set ims.eye_steps needs ims.mode=fast or frame");
  refused({{"mode", "fast"}, {"eye_steps", "129"}}, "error: --set ims.eye_steps may be at most 128");
  refused({{"mode", "fast"}, {"lamp_table", "1"}}, "error: --set ims.lamp_table may be 2 to 512, or 0");
}

}  // namespace
}  // namespace virga
