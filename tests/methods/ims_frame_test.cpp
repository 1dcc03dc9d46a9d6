// SPDX-License-Identifier: Apache-2.0
// Frames of instant multiple scattering: coherence over time, and accuracy.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <regex>

#include "methods/ims_scenes.h"
#include "methods/layer_means.h"
#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

RenderSession frames(const std::string& elements, int passes, const SettingValues& more = {}, uint64_t seed = 1) {
  SettingValues settings{{"mode", "frame"}, {"spacing", "4"}, {"walks", "2048"}};
  for (const auto& [name, value] : more) settings[name] = value;
  return rendered(sceneOf(elements),
                  {.passes = passes, .seed = seed, .layers = LayerMask::all(), .method = "ims", .settings = settings});
}

/// Light that virtual lights bring.
Image indirect(const RenderSession& session) {
  Image sum = session.film().layer(Layer::surfaceToSurface);
  for (const Layer layer : {Layer::mediaToSurface, Layer::surfaceToMedia, Layer::mediaToMedia}) {
    const Image more = session.film().layer(layer);
    for (size_t i = 0; i < sum.pixels.size(); ++i) sum.pixels[i] += more.pixels[i];
  }
  return sum;
}

/// Changes of the pixels from one picture to another, over their own value and the picture's mean, in order.
std::vector<double> changes(const Image& from, const Image& to) {
  const double level = pixelMoments(from).mean();
  std::vector<double> all;
  for (size_t i = 0; i < from.pixels.size(); ++i) {
    const auto a = static_cast<double>(mean(from.pixels[i])), b = static_cast<double>(mean(to.pixels[i]));
    all.push_back(std::fabs(a - b) / (a + level));
  }
  std::sort(all.begin(), all.end());
  return all;
}
double rootMeanSquare(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

// --- coherence ---

TEST(ImsFrame, IsAFunctionOfItsInputForAnyNumberOfThreads) {
  const auto picture = [](const std::string& scene, size_t threads) {
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return frames(scene, 2, {{"walks", "500"}, {"lights", "200"}}).film().beauty();
  };
  for (const std::string& scene : {plume(24), fog(24)}) {
    const Image one = picture(scene, 1);
    EXPECT_EQ(largestDifference(one, picture(scene, 4)), 0);
    EXPECT_EQ(largestDifference(one, picture(scene, 1)), 0);
  }
}

// The camera goes a twentieth of a pixel's width to the side. The light of virtual lights must hardly change, but where
// a silhouette or the smoke's own edge passes the middle of a pixel; with other walks in each frame it does: that is
// what flickers.
void expectCoherent(const std::string& before, const std::string& after) {
  const Image first = indirect(frames(before, 1));
  const std::vector<double> same = changes(first, indirect(frames(after, 1)));
  const std::vector<double> fresh = changes(first, indirect(frames(after, 1, {}, 2)));
  const size_t most = same.size() * 9 / 10;
  EXPECT_LT(same[most], 0.005);
  EXPECT_LT(rootMeanSquare(same), 0.5 * rootMeanSquare(fresh));
  EXPECT_GT(fresh[most], 0.02) << "the test cannot tell frames that flicker";
}
TEST(ImsFrame, NothingPopsInSmokeWhenTheCameraMoves) { expectCoherent(plume(64), plume(64, 0.002f)); }
TEST(ImsFrame, NothingPopsInFogWhenTheCameraMoves) {
  expectCoherent(fog(64), fog(64, R"(<bsdf type="diffuse"/>)", 0.002f));
}

/// A frame after the camera has moved is the one that starts there.
void expectLightsStay(const std::string& before, const std::string& after) {
  const Settings settings{{{"mode", "frame"}, {"walks", "500"}, {"lights", "50"}}, 1};
  RenderSession moved(sceneOf(before), findMethod("ims"), {.settings = settings});
  moved.step();
  moved.edit(sceneOf(after), {{{{"camera"}, Aspect::camera}}});
  moved.step();
  RenderSession fresh(sceneOf(after), findMethod("ims"), {.settings = settings});
  fresh.step();
  EXPECT_EQ(largestDifference(moved.film().beauty(), fresh.film().beauty()), 0);
}
TEST(ImsFrame, LightsStayWhenTheCameraMoves) {
  expectLightsStay(fog(24), fog(24, R"(<bsdf type="diffuse"/>)", 0.3f));
  // Without shapes there is nothing but the camera to tell where the scene is.
  const auto from = [](const std::string& place) {
    return R"(<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.3"/></medium>)" +
           pinpointSensor(place, "0, 0, 0", "0, 1, 0", 8, R"(<ref name="medium" id="fog"/>)") +
           R"(<emitter type="point"><point name="position" value="0, 1, 0"/></emitter>)";
  };
  expectLightsStay(from("0, 0, 4"), from("0, 0, 9"));
}

// Lights and tables are kept when the camera alone moves: they must not depend on the media around it.
TEST(ImsFrame, LightsStayWhenTheCameraFliesIntoTheSmoke) {
  const Settings settings{{{"mode", "frame"}, {"walks", "500"}}, 1};
  const SceneSnapshot inside =
      sceneOf(std::regex_replace(plume(24), std::regex(R"(origin="[^"]*")"), R"(origin="0.3, 0.1, 0.7")"),
              ::testing::TempDir());
  ASSERT_FALSE(inside->view.cameraMedia.vacuum());
  RenderSession moved(sceneOf(plume(24)), findMethod("ims"), {.settings = settings});
  moved.step();
  moved.edit(inside, {{{{"camera"}, Aspect::camera}}});
  moved.step();
  RenderSession fresh(inside, findMethod("ims"), {.settings = settings});
  fresh.step();
  EXPECT_EQ(largestDifference(moved.film().beauty(), fresh.film().beauty()), 0);
}

// The smoke gets 0.4 % denser, frame by frame. Light of virtual lights changes as little where walks and the choice of
// lights stay; where both are made anew, even with the same numbers, it flickers.
TEST(ImsFrame, NothingFlickersInSmokeThatHardlyChanges) {
  const auto frame = [](int number) {
    return sceneOf(std::regex_replace(plume(48), std::regex(R"(name="scale" value="12")"),
                                      fmt::format(R"(name="scale" value="{}")", 12 * std::pow(1.004, number))));
  };
  const auto changed = [&](const std::string& retrace) {
    const SettingValues settings{{"mode", "frame"}, {"spacing", "4"}, {"walks", "2048"}, {"retrace", retrace}};
    RenderSession session =
        rendered(frame(0), {.passes = 1, .layers = LayerMask::all(), .method = "ims", .settings = settings});
    Image before = session.film().layer(Layer::mediaToMedia);
    double sum = 0, level = 0;
    for (int number = 1; number <= 3; ++number) {
      const SceneSnapshot next = frame(number);
      session.nextFrame(next, differences(session.scene().description, next->description));
      session.step();
      const Image now = session.film().layer(Layer::mediaToMedia);
      for (size_t i = 0; i < now.pixels.size(); ++i)
        sum += static_cast<double>(std::fabs(mean(now.pixels[i]) - mean(before.pixels[i]))),
            level += static_cast<double>(mean(now.pixels[i]));
      before = now;
    }
    return sum / level;
  };
  const double none = changed("0"), some = changed("0.125"), all = changed("1");
  fmt::print("change: none traced anew {:.4f}, an eighth {:.4f}, all {:.4f}\n", none, some, all);
  EXPECT_LT(none, 0.01);
  EXPECT_LT(some, 0.01);
  EXPECT_GT(all, 3 * some) << "the test cannot tell frames that flicker";
}

// --- accuracy ---

void expectNear(const std::string& elements, double tolerance, int passes, const SettingValues& settings = {},
                int truthPasses = 240, const SettingValues& truthSettings = {}) {
  const RenderSession truth = rendered(
      sceneOf(elements), {.passes = truthPasses, .seed = 5, .layers = LayerMask::all(), .settings = truthSettings});
  const RenderSession own = frames(elements, passes, settings);
  const double beauty = replicateMoments(truth.film()).mean();
  for (int l = 0; l < kLayerCount; ++l) {
    const auto layer = static_cast<Layer>(l);
    const stats::Moments a = replicateMoments(own.film(), layer), b = replicateMoments(truth.film(), layer);
    const double noise = 4 * std::hypot(a.standardError(), b.standardError());
    EXPECT_NEAR(a.mean(), b.mean(), tolerance * b.mean() + 2e-3 * beauty + noise)
        << kLayerNames[static_cast<size_t>(l)];
    EXPECT_LT(noise, 0.1 * beauty) << kLayerNames[static_cast<size_t>(l)] << ": too few samples to tell ("
                                   << a.standardError() << ", " << b.standardError() << ")";
  }
}

TEST(ImsFrame, LayersOfAPlumeAreNearTheTruth) {
  expectNear(plume(48), 0.1, 8, {{"walks", "65536"}});  // few of which meet the plume
}
TEST(ImsFrame, LayersOfFogAreNearTheTruth) { expectNear(fog(32), 0.06, 16, {{"lights", "650"}}); }
/// Fog without end around a floor, a wall and other things.
std::string fogWithoutEnd(const std::string& sigmaT, const std::string& things) {
  return R"(<medium type="homogeneous" id="fog"><float name="albedo" value="0.9"/><float name="sigma_t" value=")" +
         sigmaT + R"("/></medium>)" +
         pinpointSensor("0.3, 0.3, 4", "0, -0.1, 0", "0, 1, 0", 16, R"(<ref name="medium" id="fog"/>)") + R"(
    <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/><translate y="-1"/>
      </transform><bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="-1.5"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>)" +
         things;
}
const SettingValues kSevenSegments{{"max_depth", "7"}};

// Lights lie many mean free paths apart in fog without end, most of them near the lamp: one radius by how wide they lie
// loses most of what they light.
TEST(ImsFrame, LayersOfThinFogWithoutEndAreNearTheTruth) {
  const std::string scene = fogWithoutEnd("0.1", R"(<shape type="rectangle"><transform name="to_world">
    <scale value="0.6"/><rotate x="1" angle="90"/><translate y="1.6"/></transform>
    <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>)");
  expectNear(scene, 0.15, 8, kSevenSegments, 240, kSevenSegments);
  const auto light = [&](const SettingValues& settings) {
    return pixelMoments(indirect(frames(scene, 2, settings))).mean();
  };
  EXPECT_LT(light({{"max_depth", "7"}, {"radius", "8"}}), 0.7 * light(kSevenSegments)) << "the test cannot tell";
}
// Nearly all of the fog's lights lie far out: were they kept by their power alone, the ball would have an eighth of its
// light; with balls of lights that are not fitted to it, three quarters.
TEST(ImsFrame, LayersOfABallInFogWithoutEndAreNearTheTruth) {
  const std::string scene = fogWithoutEnd("0.02", R"(<emitter type="point"><point name="position" value="2, 3, 2"/>
    <rgb name="intensity" value="20"/></emitter><shape type="sphere"><point name="center" value="0, 0.1, 0"/>
    <float name="radius" value="0.8"/><bsdf type="null"/><medium name="interior" type="homogeneous">
    <float name="sigma_t" value="5"/><float name="albedo" value="0.9"/></medium></shape>)");
  const RenderSession truth =
      rendered(sceneOf(scene), {.passes = 240, .seed = 5, .layers = LayerMask::all(), .settings = kSevenSegments});
  const RenderSession own = frames(scene, 16, {{"max_depth", "7"}, {"walks", "8192"}});
  const stats::Moments a = replicateMoments(own.film(), Layer::mediaToMedia),
                       b = replicateMoments(truth.film(), Layer::mediaToMedia);
  const double noise = 3 * std::hypot(a.standardError(), b.standardError());
  EXPECT_LT(noise, 0.2 * b.mean()) << "too few samples to tell";
  EXPECT_NEAR(a.mean(), b.mean(), 0.08 * b.mean() + noise);
}
// Within its ball a light loses less of red than of blue: by one core for all channels, that of blue, there is 2.1
// times as much of red over blue as by paths.
TEST(ImsFrame, DenseMediaOfColourKeepTheirHue) {
  const SceneSnapshot scene = sceneOf(R"(<sensor type="perspective"><float name="fov" value="30"/>
    <transform name="to_world"><lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/><rfilter type="box"/></film>
    </sensor>
    <emitter type="point"><point name="position" x="2" y="3" z="2"/><rgb name="intensity" value="20"/></emitter>
    <shape type="cube"><transform name="to_world"><scale x="1" y="0.8" z="1"/><rotate y="1" angle="30"/></transform>
      <bsdf type="null"/><medium name="interior" type="homogeneous"><rgb name="sigma_t" value="2, 4, 8"/>
      <float name="albedo" value="0.95"/></medium></shape>)");
  const LayerMeans truth = layerMeans(scene, {.passes = 320, .seed = 5, .settings = {{"max_depth", "8"}}});
  const LayerMeans own = layerMeans(
      scene,
      {.method = "ims",
       .settings = {{"mode", "frame"}, {"spacing", "2"}, {"walks", "65536"}, {"lights", "650"}, {"max_depth", "8"}}});
  const auto found = [&](size_t channel) {
    const auto at = [&](const LayerMeans& means) {
      return means.layers[static_cast<size_t>(Layer::mediaToMedia)][5 * channel + LayerMeans::kWhole];
    };
    // The passes of a frame are placed evenly together: one by one they scatter far more than their mean, 1 %.
    EXPECT_LT(at(truth).standardError(), 0.03 * at(truth).mean()) << "too few samples to tell";
    return at(own).mean() / at(truth).mean();
  };
  const double red = found(0), green = found(1), blue = found(2);
  fmt::print("light from medium to medium, over that of paths: {:.3f}, {:.3f}, {:.3f}\n", red, green, blue);
  EXPECT_NEAR(red, 1, 0.15);
  EXPECT_NEAR(blue, 1, 0.2) << "balls that are not fitted to the box lack 0.27";
  EXPECT_NEAR(red / blue, 1, 0.3);
  EXPECT_NEAR(green / blue, 1, 0.2);
}
// Bsdfs and phase functions that the kernels do not know go by their own scattering; glass goes by paths.
TEST(ImsFrame, RoughSurfacesGoTheSlowWay) {
  const std::string phong = R"(<bsdf type="phong"><rgb name="diffuse_reflectance" value="0.3"/>
    <rgb name="specular_reflectance" value="0.4"/><float name="exponent" value="10"/></bsdf>)";
  expectNear(fog(24, phong), 0.06, 16, {{"lights", "300"}});
}
TEST(ImsFrame, GlassGoesByPaths) { expectNear(fog(16, R"(<bsdf type="dielectric"/>)"), 0.06, 16, {{"lights", "300"}}); }

// Packets know point and area lamps; the sun and spots go by single rays beside them.
TEST(ImsFrame, LampsOfAllKindsLightFogThatIsEverywhere) {
  const std::string scene =
      R"(<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="0.3, 0.2, 0.1"/>
    <float name="albedo" value="0.8"/></medium>)" +
      pinpointSensor("0, 0.5, 3", "0, -0.2, 0", "0, 1, 0", 16, R"(<ref name="medium" id="fog"/>)") +
      R"(
    <emitter type="point"><point name="position" x="1" y="1.5" z="1"/><rgb name="intensity" value="4, 5, 6"/></emitter>
    <emitter type="spot"><transform name="to_world"><lookat origin="-1, 2, 0" target="0, -1, 0" up="0, 0, 1"/></transform>
      <rgb name="intensity" value="9"/></emitter>
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="90"/><translate y="2"/>
      </transform><emitter type="area"><rgb name="radiance" value="6, 5, 4"/></emitter></shape>
    <shape type="sphere"><float name="radius" value="0.5"/><bsdf type="diffuse"/></shape>
    <shape type="cube"><transform name="to_world"><scale value="3"/></transform><bsdf type="twosided"><bsdf type="diffuse"/>
      </bsdf></shape>)";
  expectNear(scene, 0.06, 32, {{"lights", "300"}, {"walks", "1024"}}, 320);
}
// An area lamp over smoke: a table for each of its points.
TEST(ImsFrame, TablesOfAnAreaLamp) {
  std::string scene = plume(24);
  const std::string lamp = scene.substr(scene.find("<emitter"), scene.find("</emitter>") + 10 - scene.find("<emitter"));
  scene.replace(scene.find(lamp), lamp.size(),
                R"(<shape type="rectangle"><transform name="to_world"><scale value="0.3"/>
    <rotate x="1" angle="90"/><translate x="-1" y="3" z="0.5"/></transform><emitter type="area"><rgb name="radiance" value="90"/>
    </emitter></shape>)");
  const RenderSession truth = rendered(
      sceneOf(scene), {.passes = 480, .seed = 5, .layers = LayerMask::all(), .settings = {{"max_depth", "2"}}});
  const RenderSession own = frames(scene, 24, {{"max_depth", "2"}});
  for (const Layer layer : {Layer::directSurface, Layer::directMedia}) {
    const stats::Moments a = replicateMoments(own.film(), layer), b = replicateMoments(truth.film(), layer);
    const double noise = 4 * std::hypot(a.standardError(), b.standardError());
    EXPECT_NEAR(a.mean(), b.mean(), 0.03 * b.mean() + noise) << kLayerNames[static_cast<size_t>(layer)];
    EXPECT_LT(noise, 0.1 * b.mean()) << "too few samples to tell";
  }
}

// Many walks, all of their lights, hardly spread, exact visibility: the frame goes to the truth.
TEST(ImsFrame, ManyLightsGoToTheTruth) {
  const std::string ball = pinpointSensor("0, 0, 3", "0.1, 0.2, 0", "0, 1, 0", 16, R"(<ref name="medium" id="fog"/>)");
  const std::string scene = R"(<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.5"/>
    <float name="albedo" value="0.9"/><phase type="hg"><float name="g" value="0.4"/></phase></medium>)" +
                            ball + R"(
    <emitter type="point"><point name="position" x="1" y="1.5" z="1"/><rgb name="intensity" value="9"/></emitter>
    <shape type="sphere"><float name="radius" value="0.5"/><bsdf type="diffuse"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="-90"/><translate y="-1"/>
      </transform><bsdf type="diffuse"/></shape>)";
  expectNear(scene, 0.02, 8,
             {{"walks", "16384"},
              {"lights", "1000000"},
              {"radius", "0.1"},
              {"visibility", "exact"},
              {"spacing", "16"},
              {"samples", "4"}},
             1500);
}

// One level of compensation finds most of what clamping takes; without it, a good part is missing.
TEST(ImsFrame, ALevelOfCompensationFindsWhatClampingTakes) {
  const std::string scene = fog(24);
  const SettingValues few{{"lights", "300"}};
  const auto level = [&](const std::string& compensation) {
    SettingValues settings = few;
    settings["compensation"] = compensation;
    return pixelMoments(indirect(frames(scene, 4, settings))).mean();
  };
  const RenderSession truth = rendered(sceneOf(scene), {.passes = 160, .seed = 5, .layers = LayerMask::all()});
  const double all = pixelMoments(indirect(truth)).mean(), clamped = level("none"), found = level("sampled");
  EXPECT_LT(clamped, 0.9 * all) << "the test cannot tell";
  EXPECT_NEAR(found, all, 0.4 * (all - clamped));
}
TEST(ImsFrame, CompensationIsCoherentToo) {
  const SettingValues compensated{{"compensation", "sampled"}};
  const std::vector<double> same =
      changes(indirect(frames(plume(48), 1, compensated)), indirect(frames(plume(48, 0.002f), 1, compensated)));
  EXPECT_LT(same[same.size() * 9 / 10], 0.005);
}

TEST(ImsFrame, PathsOfOneSegmentShowLampsAlone) {
  EXPECT_EQ(pixelMoments(frames(plume(16), 1, {{"max_depth", "1"}}).film().beauty()).mean(), 0);
}
TEST(ImsFrame, PathsOfTwoSegmentsAreDirectLight) {
  const RenderSession session = frames(plume(16), 1, {{"max_depth", "2"}});
  EXPECT_EQ(pixelMoments(indirect(session)).mean(), 0);
  EXPECT_GT(pixelMoments(session.film().beauty()).mean(), 0);
}

TEST(ImsFrame, RefusesWhatItCannotDo) {
  EXPECT_THROW(frames(fog(8), 1, {{"compensation", "path"}}), Error);
  EXPECT_THROW(frames(fog(8), 1, {{"compensation", "sampled"}, {"levels", "2"}}), Error);
  EXPECT_THROW(frames(fog(8), 1, {{"aim", "1"}}), Error);
  EXPECT_THROW(frames(fog(8), 1, {{"mode", "exact"}, {"compensation", "spread"}}), Error);
  EXPECT_THROW(frames(fog(8), 1, {{"visibility", "minimum_depth"}}), Error);
  EXPECT_THROW(frames(fog(8), 1, {{"show", "lost"}}), Error);
}

TEST(ImsFrame, AStopLeavesNothing) {
  std::stop_source stop;
  stop.request_stop();
  RenderSession session(sceneOf(fog(8)), findMethod("ims"),
                        {.settings = {.values = {{"mode", "frame"}, {"walks", "500"}}}});
  EXPECT_FALSE(session.step({}, stop.get_token()).completed);
  EXPECT_TRUE(session.step().completed);
  EXPECT_TRUE(session.step().biased);
}

}  // namespace
}  // namespace virga
