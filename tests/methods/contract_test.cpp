// SPDX-License-Identifier: Apache-2.0
// What every method promises: edits, stops, replicates, layers, the same picture on any number of threads.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "loaders/mitsuba_xml.h"
#include "methods/rendering.h"
#include "scene/builder.h"

namespace virga {
namespace {

using namespace virga::testing;

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

RenderSession sessionOf(const SceneSnapshot& scene, LayerMask layers = LayerMask::none()) {
  return RenderSession(scene, findMethod("path"), {.settings = {.values = {}, .seed = 7}, .layers = layers});
}

struct Edit {
  const char *node, *property;
  Value value;
  Aspect aspect;
};

TEST(Contract, AnEditedSceneRendersAsIfItWereNew) {
  const Edit edits[] = {
      {"lamp", "position", Vec3(2, 2, 2), Aspect::emitterPose},
      {"camera", "to_world", Matrix4::lookAt({1, 1, 4}, {0, 0, 0}, {0, 1, 0}), Aspect::camera},
      {"box", "to_world", Matrix4::translation(0.5, 0.2, 0) * Matrix4::scaling(0.7, 0.9, 0.8), Aspect::shapePose},
      {"cloud", "sigma_t", 4.0, Aspect::mediumParameters},
  };
  SceneDescription current = description();
  SceneSnapshot snapshot = buildScene(current);
  RenderSession session = sessionOf(snapshot);
  for (int i = 0; i < 3; ++i) session.step();
  for (const Edit& edit : edits) {
    const SceneDescription next = edited(current, edit.node, edit.property, edit.value);
    const ChangeSet changes = differences(current, next);
    EXPECT_TRUE(changes.touches(edit.aspect)) << edit.node;
    const Image before = session.film().beauty();
    snapshot = buildScene(next, {}, snapshot);
    session.edit(snapshot, changes);
    EXPECT_EQ(session.film().passes(), 0);
    RenderSession fresh = sessionOf(buildScene(next));
    for (int i = 0; i < 3; ++i) session.step(), fresh.step();
    EXPECT_EQ(largestDifference(session.film().beauty(), fresh.film().beauty()), 0) << edit.node;
    EXPECT_GT(largestDifference(session.film().beauty(), before), 0.01f) << "the edit must be visible";
    current = next;
  }
}

TEST(Contract, AnEditSharesWhatItDoesNotTouch) {
  const SceneDescription before = description();
  const SceneSnapshot first = buildScene(before);
  const SceneSnapshot second = buildScene(edited(before, "lamp", "position", Vec3(1, 2, 3)), {}, first);
  ASSERT_EQ(first->view.surfaces.size, second->view.surfaces.size);
  for (int i = 0; i < first->view.surfaces.size; ++i)
    EXPECT_EQ(first->view.surfaces[i].positions, second->view.surfaces[i].positions);
}

TEST(Contract, NoEditLosesNothing) {
  const SceneDescription same = description();
  const SceneSnapshot scene = buildScene(same);
  RenderSession session = sessionOf(scene);
  session.step();
  session.edit(buildScene(same, {}, scene), differences(same, same));
  EXPECT_EQ(session.film().passes(), 1);
}

TEST(Contract, LayersSumToTheBeautyBitForBit) {
  RenderSession session = sessionOf(buildScene(description()), LayerMask::all());
  for (int i = 0; i < 11; ++i) session.step();
  Image sum(40, 32);
  for (int l = 0; l < kLayerCount; ++l) {
    const Image layer = session.film().layer(static_cast<Layer>(l));
    for (size_t i = 0; i < sum.pixels.size(); ++i) sum.pixels[i] += layer.pixels[i];
  }
  EXPECT_EQ(largestDifference(sum, session.film().beauty()), 0);
}

TEST(Contract, RequestedLayersDoNotChangeThePicture) {
  const SceneSnapshot scene = buildScene(description());
  RenderSession plain = sessionOf(scene), some = sessionOf(scene, LayerMask::none().with(Layer::directMedia));
  for (int i = 0; i < 5; ++i) plain.step(), some.step();
  EXPECT_EQ(largestDifference(plain.film().beauty(), some.film().beauty()), 0);
  EXPECT_GT(pixelMoments(some.film().layer(Layer::directMedia)).mean(), 0);
}

TEST(Contract, ThePictureDoesNotDependOnTheNumberOfThreads) {
  const SceneSnapshot scene = buildScene(description());
  const auto renderWith = [&](size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    RenderSession session = sessionOf(scene);
    for (int i = 0; i < 4; ++i) session.step();
    return session.film().beauty();
  };
  EXPECT_EQ(largestDifference(renderWith(1), renderWith(4)), 0);
}

TEST(Contract, PassesArePureFunctionsOfTheirIndex) {
  const SceneSnapshot scene = buildScene(description());
  const auto method = findMethod("path").create();
  method->prepare(scene, {.values = {}, .seed = 3}, LayerMask::none());
  const auto passAlone = [&](int64_t index) {
    Film film(40, 32, LayerMask::none());
    method->pass(index, {}, {}, film.frame());
    film.average(0);
    return film.beauty();
  };
  const Image ninth = passAlone(9), second = passAlone(2);
  EXPECT_EQ(largestDifference(ninth, passAlone(9)), 0);
  EXPECT_GT(largestDifference(ninth, second), 0);
}

TEST(Contract, SeedsAndReplicatesAreIndependent) {
  const SceneSnapshot scene = buildScene(description());
  RenderSession session = sessionOf(scene);
  for (int i = 0; i < Film::kReplicates; ++i) session.step();
  EXPECT_GT(largestDifference(session.film().replicateBeauty(0), session.film().replicateBeauty(1)), 0);
}

TEST(Contract, AStoppedPassLeavesTheFilmAsItWas) {
  RenderSession session = sessionOf(buildScene(description()));
  session.step();
  const Image before = session.film().beauty();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(session.step({}, stop.get_token()).completed);
  EXPECT_EQ(session.film().passes(), 1);
  EXPECT_EQ(largestDifference(session.film().beauty(), before), 0);
}

TEST(Contract, AStopIsHonouredQuickly) {
  // A film of which a pass takes far longer than the test waits.
  const SceneSnapshot scene =
      buildScene(edited(edited(description(), "box", "to_world", Matrix4::scaling(3, 3, 3)), "cloud", "sigma_t", 20.0),
                 {.filmSize = {{2000, 2000}}});
  RenderSession session = sessionOf(scene);
  std::stop_source stop;
  std::atomic<bool> completed{true};
  std::thread worker([&] { completed = session.step({}, stop.get_token()).completed; });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  stop.request_stop();
  worker.join();
  EXPECT_FALSE(completed);
}

TEST(Contract, UnknownSettingsAreRefused) {
  const SceneSnapshot scene = buildScene(description());
  const auto message = [&](const std::string& name, const std::string& value) -> std::string {
    try {
      RenderSession(scene, findMethod("path"), {.settings = {.values = {{name, value}}, .seed = 0}, .layers = {}});
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message("max_dept", "3"),
            "error: method \"path\" has no setting \"max_dept\"; did you mean \"max_depth\"?\n"
            "  note: available: max_depth, rr_depth, equiangular_depth, shared_paths, lamp_table");
  EXPECT_EQ(message("max_depth", "deep"), "error: --set path.max_depth: \"deep\" is not an integer of at least -1");
}

TEST(Contract, EveryMethodStatesWhatItIs) {
  for (const MethodInfo& method : methodRegistry()) {
    EXPECT_FALSE(method.summary.empty()) << method.name;
    EXPECT_NE(method.layers.bits, 0u) << method.name;
    EXPECT_NE(method.create(), nullptr) << method.name;
  }
}

}  // namespace
}  // namespace virga
