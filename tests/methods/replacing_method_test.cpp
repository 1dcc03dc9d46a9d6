// SPDX-License-Identifier: Apache-2.0
// A method that refines one picture instead of averaging many: the other half of the contract, which `path` does not
// use.
#include <gtest/gtest.h>

#include <cstring>

#include "methods/rendering.h"

namespace virga {
namespace {

using namespace virga::testing;

/// Relaxes toward a grey of `target`, half the way with each pass, as an iterative solver would. Keeps its solution
/// when the camera moves, not when a light does. Its passes depend on their order, so it has a state to save.
class Relaxation final : public Method {
 public:
  void prepare(SceneSnapshot, const Settings&, LayerMask) override {}
  Reset update(SceneSnapshot, const ChangeSet& changes) override {
    if (changes.empty()) return Reset::nothingLost;
    if (!changes.touches(Aspect::emitterIntensity)) return Reset::film;
    value_ = 0;
    return Reset::caches;
  }
  PassResult pass(int64_t, const Budget&, std::stop_token stop, PassFrame& frame) override {
    if (stop.stop_requested()) return {.kind = PassResult::Kind::replaced, .completed = false};
    value_ += 0.5f * (kTarget - value_);
    LayerRadiance radiance;
    radiance.add(Layer::mediaToMedia, Rgb(value_));
    for (int y = 0; y < frame.height(); ++y)
      for (int x = 0; x < frame.width(); ++x) frame.set(x, y, radiance);
    const double residual = static_cast<double>((kTarget - value_) / kTarget);
    return {.kind = PassResult::Kind::replaced, .biased = true, .converged = residual < 1e-3, .residual = residual};
  }
  SettingValues settingsInForce() const override { return {}; }
  Overlay overlay() const override { return {{{Vec3(1, 2, 3), Rgb(0, 1, 0)}}}; }
  std::string saveState() const override { return std::string(reinterpret_cast<const char*>(&value_), sizeof value_); }
  void loadState(std::string_view state) override { std::memcpy(&value_, state.data(), sizeof value_); }

  static constexpr float kTarget = 2;

 private:
  float value_ = 0;
};

const MethodInfo kRelaxation{
    "relaxation", "for tests", "none", LayerMask::none().with(Layer::mediaToMedia), Accuracy::biased, {}, [] {
      return std::unique_ptr<Method>(std::make_unique<Relaxation>());
    }};

SceneSnapshot anyScene() {
  return sceneOf(pinpointSensor("0, 0, 5", "0, 0, 0", "0, 1, 0", 4) + R"(<emitter type="constant" id="sky"/>)");
}

RenderSession sessionAfter(int passes) {
  RenderSession session(anyScene(), kRelaxation,
                        {.settings = {}, .layers = LayerMask::none().with(Layer::mediaToMedia)});
  for (int i = 0; i < passes; ++i) session.step();
  return session;
}

float level(const RenderSession& session) { return session.film().beauty().at(0, 0).r; }

TEST(ReplacingMethod, APassTakesThePlaceOfThePicture) {
  EXPECT_EQ(level(sessionAfter(1)), 1.f);
  EXPECT_EQ(level(sessionAfter(2)), 1.5f) << "the mean of two iterations would be 1.25";
  EXPECT_EQ(sessionAfter(2).film().layer(Layer::mediaToMedia).at(1, 1).g, 1.5f);
}

TEST(ReplacingMethod, HasNoVarianceToReport) {
  const RenderSession session = sessionAfter(3);
  EXPECT_FALSE(session.film().hasVariance());
  EXPECT_FALSE(session.film().estimatedRelMse().has_value());
}

TEST(ReplacingMethod, SaysWhenItHasConverged) {
  RenderSession session = sessionAfter(3);
  PassResult result = session.step();
  EXPECT_TRUE(result.biased);
  EXPECT_FALSE(result.converged);
  EXPECT_DOUBLE_EQ(result.residual.value(), 1.0 / 16);
  for (int i = 0; i < 10; ++i) result = session.step();
  EXPECT_TRUE(result.converged);
}

TEST(ReplacingMethod, KeepsWhatAnEditDoesNotTouch) {
  RenderSession session = sessionAfter(4);
  session.edit(anyScene(), {{{"camera", Aspect::camera}}});
  EXPECT_EQ(session.film().passes(), 0);
  session.step();
  EXPECT_EQ(level(session), 2 - 2.f / 32) << "the solution goes on where it was";
  session.edit(anyScene(), {{{"sky", Aspect::emitterIntensity}}});
  session.step();
  EXPECT_EQ(level(session), 1.f) << "the solution starts anew";
}

TEST(ReplacingMethod, AStoppedPassLeavesThePictureAsItWas) {
  RenderSession session = sessionAfter(2);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(session.step({}, stop.get_token()).completed);
  EXPECT_EQ(level(session), 1.5f);
}

TEST(ReplacingMethod, ItsStateCanBeSaved) {
  Relaxation first, second;
  Film film(4, 4, LayerMask::none());
  for (int i = 0; i < 3; ++i) first.pass(i, {}, {}, film.frame());
  second.loadState(first.saveState());
  second.pass(3, {}, {}, film.frame());
  film.replace();
  EXPECT_EQ(film.beauty().at(0, 0).r, 2 - 2.f / 16);
}

}  // namespace
}  // namespace virga
