// SPDX-License-Identifier: Apache-2.0
// What every method promises, for `ims`; scenes and settings that make little sense; light that does not get anywhere.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <cmath>
#include <regex>
#include <set>
#include <thread>

#include "loaders/mitsuba_xml.h"
#include "methods/ims_checks.h"
#include "scene/builder.h"

namespace virga {
namespace {

using namespace virga::testing;

constexpr int kWidth = 40, kHeight = 32;
constexpr const char* kScene = R"(<scene version="3.0.0">
  <sensor type="perspective" id="camera"><float name="fov" value="45"/>
    <transform name="to_world"><lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="40"/><integer name="height" value="32"/></film></sensor>
  <emitter type="point" id="lamp"><point name="position" x="-2" y="3" z="1"/><rgb name="intensity" value="30"/></emitter>
  <shape type="rectangle" id="ground"><transform name="to_world"><scale value="5"/><rotate x="1" angle="-90"/>
    <translate y="-1"/></transform></shape>
  <shape type="sphere" id="glass"><float name="radius" value="0.3"/><point name="center" x="1.3" y="-0.5" z="0.5"/>
    <bsdf type="dielectric"/></shape>
  <shape type="cube" id="box"><bsdf type="null"/>
    <medium name="interior" type="homogeneous" id="cloud"><float name="sigma_t" value="1.5"/><float name="albedo" value="0.9"/></medium>
  </shape></scene>)";

SceneDescription description() { return parseMitsubaXml(kScene, "contract.xml", "."); }

const std::vector<SettingValues> kVariants = {
    {{"walks", "200"}},
    {{"walks", "200"}, {"compensation", "sampled"}, {"paths", "2"}, {"v1", "2"}},
    {{"walks", "200"}, {"compensation", "none"}, {"show", "lost"}}};

RenderSession sessionOf(const SceneSnapshot& scene, const SettingValues& settings,
                        LayerMask layers = LayerMask::none()) {
  return RenderSession(scene, findMethod("ims"), {.settings = {.values = settings, .seed = 7}, .layers = layers});
}

TEST(ImsContract, ThePictureDoesNotDependOnTheNumberOfThreads) {
  const SceneSnapshot scene = buildScene(description());
  for (const SettingValues& settings : kVariants) {
    const auto renderWith = [&](size_t threads) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      RenderSession session = sessionOf(scene, settings);
      for (int i = 0; i < 4; ++i) session.step();
      return session.film().beauty();
    };
    EXPECT_EQ(largestDifference(renderWith(1), renderWith(4)), 0);
  }
}

TEST(ImsContract, PassesArePureFunctionsOfTheirIndex) {
  const SceneSnapshot scene = buildScene(description());
  for (const SettingValues& settings : kVariants) {
    const auto make = [&] {
      auto method = findMethod("ims").create();
      method->prepare(scene, {.values = settings, .seed = 3}, LayerMask::none());
      return method;
    };
    const auto one = make(), other = make();
    const auto passAlone = [&](Method& method, int64_t index) {
      Film film(kWidth, kHeight, LayerMask::none());
      method.pass(index, {}, {}, film.frame());
      film.average(0);
      return film.beauty();
    };
    // Resumed, and in another order.
    const Image ninth = passAlone(*one, 9), second = passAlone(*one, 2);
    EXPECT_EQ(largestDifference(second, passAlone(*other, 2)), 0);
    EXPECT_EQ(largestDifference(ninth, passAlone(*other, 9)), 0);
    EXPECT_GT(largestDifference(ninth, second), 0);
    EXPECT_TRUE(one->saveState().empty());
  }
}

TEST(ImsContract, LayersSumToTheBeautyAndAskingForThemChangesNothing) {
  const SceneSnapshot scene = buildScene(description());
  for (const SettingValues& settings : kVariants) {
    RenderSession plain = sessionOf(scene, settings), layered = sessionOf(scene, settings, LayerMask::all());
    for (int i = 0; i < 9; ++i) plain.step(), layered.step();
    Image sum(kWidth, kHeight);
    for (int l = 0; l < kLayerCount; ++l) {
      const Image layer = layered.film().layer(static_cast<Layer>(l));
      for (size_t i = 0; i < sum.pixels.size(); ++i) sum.pixels[i] += layer.pixels[i];
    }
    EXPECT_EQ(largestDifference(sum, layered.film().beauty()), 0);
    for (size_t i = 0; i < sum.pixels.size(); ++i)
      EXPECT_NEAR(plain.film().beauty().pixels[i].g, sum.pixels[i].g, 1e-5f * (1 + sum.pixels[i].g));
  }
}

/// Pixels of a crop window of the scene that differ from the same ones of the whole picture, after three passes; but
/// for the `margin` along its edge.
int differingInCrop(const SettingValues& settings, int margin) {
  const auto withCrop = [](const std::string& crop) {
    std::string text = kScene;
    const std::string size = R"(<integer name="height" value="32"/>)";
    text.insert(text.find(size) + size.size(), crop);
    return buildScene(parseMitsubaXml(text, "crop.xml", "."));
  };
  RenderSession whole = sessionOf(withCrop(""), settings);
  RenderSession part =
      sessionOf(withCrop(R"(<integer name="crop_offset_x" value="11"/><integer name="crop_offset_y" value="5"/>
      <integer name="crop_width" value="18"/><integer name="crop_height" value="20"/>)"),
                settings);
  for (int i = 0; i < 3; ++i) whole.step(), part.step();
  const Image all = whole.film().beauty(), crop = part.film().beauty();
  EXPECT_EQ(crop.width, 18);
  int different = 0;
  for (int y = margin; y < crop.height - margin; ++y)
    for (int x = margin; x < crop.width - margin; ++x) {
      const Rgb a = crop.pixels[static_cast<size_t>(y * crop.width + x)],
                b = all.pixels[static_cast<size_t>((y + 5) * all.width + x + 11)];
      different += std::fabs(a.g - b.g) > 1e-3f * b.g ? 1 : 0;
    }
  return different;
}

TEST(ImsContract, ACropWindowIsPartOfThePicture) {
  // Rays differ in their last bits, which may send one or the other another way.
  EXPECT_LE(differingInCrop(kVariants[1], 0), 3);
  for (const char* mode : {"fast", "frame"})
    EXPECT_LE(differingInCrop({{"walks", "200"}, {"mode", mode}, {"spacing", "2"}}, 4), 3) << mode;
  const SettingValues sampled{{"walks", "200"}, {"mode", "frame"}, {"spacing", "2"}, {"compensation", "sampled"}};
  EXPECT_LE(differingInCrop(sampled, 4), 3);
}

TEST(ImsContract, AnEditedSceneRendersAsIfItWereNew) {
  struct Edit {
    const char *node, *property;
    Value value;
  };
  const Edit edits[] = {{"lamp", "position", Vec3(2, 2, 2)},
                        {"camera", "to_world", Matrix4::lookAt({1, 1, 4}, {0, 0, 0}, {0, 1, 0})},
                        {"box", "to_world", Matrix4::translation(0.5, 0.2, 0) * Matrix4::scaling(0.7, 0.9, 0.8)},
                        {"ground", "to_world",
                         Matrix4::translation(0, -2, 0) * Matrix4::rotation(1, 0, 0, -90) * Matrix4::scaling(9, 9, 9)},
                        {"cloud", "sigma_t", 4.0}};
  SceneDescription current = description();
  SceneSnapshot snapshot = buildScene(current);
  RenderSession session = sessionOf(snapshot, kVariants[0]);
  for (int i = 0; i < 3; ++i) session.step();
  for (const Edit& edit : edits) {
    const SceneDescription next = edited(current, edit.node, edit.property, edit.value);
    const Image before = session.film().beauty();
    snapshot = buildScene(next, {}, snapshot);
    session.edit(snapshot, differences(current, next));
    EXPECT_EQ(session.film().passes(), 0);
    RenderSession fresh = sessionOf(buildScene(next), kVariants[0]);
    for (int i = 0; i < 3; ++i) session.step(), fresh.step();
    EXPECT_EQ(largestDifference(session.film().beauty(), fresh.film().beauty()), 0) << edit.node;
    EXPECT_EQ(session.method().settingsInForce(), fresh.method().settingsInForce()) << edit.node;
    EXPECT_GT(largestDifference(session.film().beauty(), before), 0.01f) << "the edit must be visible";
    current = next;
  }
}

TEST(ImsContract, AStopIsHonouredQuickly) {
  const SceneSnapshot scene =
      buildScene(edited(edited(description(), "box", "to_world", Matrix4::scaling(3, 3, 3)), "cloud", "sigma_t", 20.0),
                 {.filmSize = {{2000, 2000}}});
  RenderSession session = sessionOf(scene, {{"walks", "100"}, {"paths", "50"}});
  std::stop_source stop;
  std::atomic<bool> completed{true};
  std::thread worker([&] { completed = session.step({}, stop.get_token()).completed; });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  stop.request_stop();
  worker.join();
  EXPECT_FALSE(completed);
}

// --- settings ---

TEST(ImsSettings, InForceAreThoseThatWereGivenAndTheOthersDefaults) {
  const SceneSnapshot scene = buildScene(description());
  const SettingValues given = {{"walks", "77"},
                               {"lights", "3"},
                               {"paths", "5"},
                               {"radius", "0.25"},
                               {"compensation", "sampled"},
                               {"levels", "4"},
                               {"ending", "reduced"},
                               {"v1", "2"},
                               {"v2", "3"},
                               {"p1", "6"},
                               {"p2", "7"},
                               {"transmittance", "mean"},
                               {"visibility", "none"},
                               {"show", "compensation"},
                               {"max_depth", "9"},
                               {"rr_depth", "2"}};
  const SettingValues found = sessionOf(scene, given).method().settingsInForce();
  for (const auto& [name, value] : given) EXPECT_EQ(found.at(name), value) << name;
  EXPECT_EQ(found.at("bound"), "16");
  const SettingValues defaults = sessionOf(scene, {}).method().settingsInForce();
  std::set<std::string> listed, told;
  for (const SettingInfo& info : findMethod("ims").settings) listed.insert(std::string(info.name));
  for (const auto& [name, value] : defaults) told.insert(name);
  EXPECT_EQ(told, listed);
  for (const SettingInfo& info : findMethod("ims").settings) {
    if (info.name == "radius" || info.name == "bound" || info.defaultValue.starts_with("the scene")) continue;
    EXPECT_TRUE(info.defaultValue.starts_with(defaults.at(std::string(info.name)))) << info.name;
  }
  EXPECT_EQ(defaults.at("lights"), "8") << "the medium is homogeneous";
  // 0.3 of the ground's ten units.
  EXPECT_EQ(defaults.at("radius"), "3");
  EXPECT_NEAR(std::stod(defaults.at("bound")), 1.0 / 9, 1e-6);
}

std::string messageOf(const SceneSnapshot& scene, const SettingValues& settings) {
  try {
    sessionOf(scene, settings);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ImsSettings, WhatMakesNoSenseIsRefused) {
  const SceneSnapshot scene = buildScene(description());
  const auto refused = [&](const SettingValues& settings, const char* message) {
    EXPECT_TRUE(messageOf(scene, settings).starts_with(message)) << messageOf(scene, settings);
  };
  refused({{"walks", "0"}}, "error: --set ims.walks: \"0\" is not an integer of at least 1");
  for (const std::string many : {"4194305", "99999999999"})
    refused({{"walks", many}},
            ("error: --set ims.walks: \"" + many + "\" is not an integer from 1 to 4194304").c_str());
  refused({{"walks", "-99999999999"}}, "error: --set ims.walks: \"-99999999999\" is not an integer of at least 1");
  refused({{"lights", "99999999999"}},
          "error: --set ims.lights: \"99999999999\" is not an integer from 1 to 2147483647");
  refused({{"lights", "0"}}, "error: --set ims.lights: \"0\" is not an integer of at least 1");
  refused({{"paths", "-1"}}, "error: --set ims.paths: \"-1\" is not an integer of at least 0");
  refused({{"v1", "0"}}, "error: --set ims.v1: \"0\" is not an integer of at least 1");
  refused({{"levels", "-2"}}, "error: --set ims.levels: \"-2\" is not an integer of at least -1");
  for (const char* number : {"0", "-1", "nan", "inf", "near"}) {
    refused({{"radius", number}}, "error: --set ims.radius: ");
    refused({{"bound", number}}, "error: --set ims.bound: ");
    EXPECT_TRUE(messageOf(scene, {{"bound", number}}).find("a number above 0 and up to 3.4e+38") != std::string::npos);
  }
  refused({{"radius", "1"}, {"bound", "1"}}, "error: --set ims.radius and ims.bound say the same");
  refused({{"show", "compensation"}}, "error: --set ims.show=compensation needs ims.compensation=sampled");
  refused({{"show", "compensation"}, {"compensation", "none"}},
          "error: --set ims.show=compensation needs ims.compensation=sampled");
  refused({{"retrace", "0.5"}, {"walks", "262145"}}, "error: --set ims.retrace=0.5 would keep nothing: ");
  EXPECT_EQ(messageOf(scene, {{"retrace", "0.5"}, {"walks", "262144"}}), "accepted");
  refused({{"compensation", "some"}}, "error: --set ims.compensation: ");
  refused({{"visibilty", "none"}}, "error: method \"ims\" has no setting \"visibilty\"; did you mean \"visibility\"?");
}

// --- scenes ---

const std::string kCamera = R"(<sensor type="perspective"><float name="fov" value="60"/>
  <transform name="to_world"><lookat origin="0.2, 0.4, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
  <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>)";
const std::string kFoggyCamera =
    R"(<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.4"/><float name="albedo" value="0.9"/></medium>)" +
    std::string(kCamera).replace(kCamera.find("</sensor>"), 9, R"(<ref name="medium" id="fog"/></sensor>)");
std::string ballOf(const std::string& parameters) {
  return fmt::format(
      R"(<shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous">{}</medium></shape>)",
      parameters);
}
const std::string kCloud = ballOf(R"(<float name="sigma_t" value="2"/><float name="albedo" value="0.9"/>)");
const std::string kPanel =
    R"(<shape type="sphere"><point name="center" x="-2" y="1" z="2"/><float name="radius" value="0.5"/>
  <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>)";
const std::string kSky = R"(<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>)";
const std::string kPoint =
    R"(<emitter type="point"><point name="position" x="0.3" y="0.2" z="0.1"/><rgb name="intensity" value="3"/></emitter>)";

Film filmOf(const std::string& elements, const SettingValues& settings = {}, int passes = 8) {
  SettingValues all = settings;
  all.insert({"walks", "200"});
  RenderSession session = rendered(sceneOf(elements), {.passes = passes, .method = "ims", .settings = all});
  EXPECT_EQ(session.film().nonFiniteSamples(), 0u) << elements;
  return session.film();
}
double brightness(const Film& film) { return pixelMoments(film.beauty()).mean(); }

TEST(ImsRobustness, WithoutLightThePictureIsBlack) {
  const std::string dark[] = {kCamera,
                              kCamera + kCloud,
                              kFoggyCamera,
                              kFoggyCamera + kCloud,
                              kCamera + kCloud + R"(<emitter type="point"><rgb name="intensity" value="0"/></emitter>)",
                              kCamera + R"(<shape type="sphere"/>)",
                              kFoggyCamera + R"(<emitter type="constant"/>)",
                              kFoggyCamera + R"(<shape type="sphere"/><emitter type="constant"/>)",
                              std::regex_replace(kFoggyCamera, std::regex(R"(<float name="sigma_t" value="0.4"/>)"),
                                                 R"(<rgb name="sigma_t" value="4, 0.4, 0.04"/>)") +
                                  R"(<emitter type="constant"/>)"};
  for (const std::string& elements : dark)
    for (const SettingValues& settings :
         {SettingValues{}, {{"compensation", "sampled"}}, {{"compensation", "none"}, {"show", "lost"}}})
      EXPECT_EQ(brightness(filmOf(elements, settings)), 0) << elements;
  for (const std::string& elements : dark)
    for (const char* mode : {"fast", "frame"}) EXPECT_EQ(brightness(filmOf(elements, {{"mode", mode}}, 2)), 0) << mode;
}

TEST(ImsRobustness, WhatOnlyAbsorbsShowsTheLampsAlone) {
  const std::string black = ballOf(R"(<float name="sigma_t" value="2"/><float name="albedo" value="0"/>)");
  for (const SettingValues& settings : {SettingValues{}, {{"compensation", "sampled"}}, {{"paths", "4"}}})
    EXPECT_EQ(brightness(filmOf(kCamera + black + kPoint, settings)), 0);
  for (const char* mode : {"fast", "frame"})
    EXPECT_EQ(brightness(filmOf(kCamera + black + kPoint, {{"mode", mode}}, 2)), 0) << mode;
}

TEST(ImsRobustness, DepthsWithoutIndirectLight) {
  const auto level = [](const char* depth, Layer layer) {
    const RenderSession session =
        rendered(sceneOf(kCamera + kCloud + kPanel + kSky), {.passes = 8,
                                                             .layers = LayerMask::all(),
                                                             .method = "ims",
                                                             .settings = {{"walks", "200"}, {"max_depth", depth}}});
    return pixelMoments(session.film().layer(layer)).mean();
  };
  EXPECT_EQ(level("0", Layer::emission), 0);
  EXPECT_GT(level("1", Layer::emission), 0);
  EXPECT_EQ(level("1", Layer::directMedia), 0);
  EXPECT_GT(level("2", Layer::directMedia), 0);
  EXPECT_EQ(level("2", Layer::mediaToMedia), 0);
  EXPECT_GT(level("3", Layer::mediaToMedia), 0);
}

// Virtual lights do not carry this light; it is there all the same, without lamps too.
TEST(ImsRobustness, MediaThatGlow) {
  const std::string glow = ballOf(R"(<float name="sigma_t" value="2"/><rgb name="emission" value="1, 2, 3"/>)");
  const SceneSnapshot scene = sceneOf(kCamera + glow);
  const auto beauty = [&](const std::string& method, const SettingValues& settings) {
    return brightness(rendered(scene, {.passes = 64, .method = method, .settings = settings}).film());
  };
  const double truth = beauty("path", {});
  for (const char* mode : {"exact", "fast", "frame"})
    EXPECT_NEAR(beauty("ims", {{"mode", mode}}), truth, 0.02 * truth) << mode;
}

// --- lights where they are hard: means agree with path by a ratio, for tails are heavy ---

void expectRatio(const std::string& elements, double tolerance, const SettingValues& settings = {}) {
  const double truth =
      brightness(rendered(sceneOf(elements), {.passes = 256, .settings = {{"max_depth", "5"}}}).film());
  SettingValues all = settings;
  all.insert({{"walks", "1000"}, {"radius", "0.7"}, {"max_depth", "5"}});
  const double found = brightness(filmOf(elements, all, 160));
  EXPECT_GT(truth, 0) << elements;
  EXPECT_NEAR(found / truth, 1, tolerance) << elements;
}

TEST(ImsRobustness, PointLightsInsideOfMedia) {
  for (const SettingValues& settings : {SettingValues{}, {{"compensation", "sampled"}}})
    for (const std::string& scene : {kCamera + kCloud, kFoggyCamera, kFoggyCamera + kCloud})
      expectRatio(scene + kPoint, 0.2, settings);
}

// Fog without end is inside of the cloud, too, and around it where the walks leave it.
TEST(ImsRobustness, ALampInACloudInFogWithoutEnd) {
  const std::string lamp = R"(<shape type="sphere"><float name="radius" value="0.4"/><emitter type="area">
    <rgb name="radiance" value="5"/></emitter></shape>)";
  const SceneSnapshot scene = sceneOf(kFoggyCamera + kCloud + lamp);
  const Estimates truth = estimates(scene, "path", {{"max_depth", "6"}}, {.sets = 48, .seed = 1});
  const Estimates found =
      estimates(scene, "ims", {{"max_depth", "6"}, {"walks", "1024"}, {"radius", "0.5"}}, {.sets = 48, .seed = 2});
  expectSame(found, truth, "lamp in a cloud in fog");
  expectPower(found, truth, {{Layer::mediaToMedia, 0.025}}, "lamp in a cloud in fog");
}

// Nothing tells a length but the fog itself: the default radius must not come from that.
TEST(ImsRobustness, ASceneWithoutShapesHasARadius) {
  const SceneSnapshot scene = sceneOf(kFoggyCamera + kPoint);
  const SettingValues values = sessionOf(scene, {}).method().settingsInForce();
  EXPECT_GT(std::stof(values.at("radius")), 0.05f) << "a part of the mean free path, not of a point";
  EXPECT_TRUE(std::isfinite(std::stof(values.at("bound"))));
}

TEST(ImsRobustness, ExtremeBounds) {
  const auto answer = [](const char* bound) {
    return messageOf(sceneOf(kCamera + kCloud + kPanel), {{"bound", bound}});
  };
  for (const char* bound : {"1e-30", "1e30"}) EXPECT_NE(answer(bound).find("out of proportion"), std::string::npos);
  for (const char* bound : {"1e-6", "1e-3", "1e3", "1e8"})
    for (const char* compensation : {"path", "sampled"})
      EXPECT_GT(brightness(filmOf(kCamera + kCloud + kPanel, {{"bound", bound}, {"compensation", compensation}})), 0)
          << bound << " " << compensation;
}

}  // namespace
}  // namespace virga
