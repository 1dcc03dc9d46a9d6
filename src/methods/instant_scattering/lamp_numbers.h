// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/sampler.h"
#include "core/warp.h"
#include "scene/lamp_choice.h"

namespace virga {

// Which points of lamps light an eye ray: what MarchedLight asks for. Points come in groups.

/// A point of a lamp that is to be sampled.
struct ChosenLamp {
  int index = 0;     ///< of the emitter
  float chance = 0;  ///< how many of the points of this kind are expected to be this lamp's; 0: there is no lamp
  Vec2 u;            ///< place on it
  enum class Sky { no, bright, even } sky = Sky::no;  ///< one of two sets of directions of an environment
};

/// Light of a chosen lamp as seen from x. Of an environment half of the points are where it is bright, which may be a
/// sun alone, and half are all around, each half weighted by the balance heuristic.
VIRGA_HD inline LightSample sampleLamp(const SceneView& scene, const ChosenLamp& lamp, Vec3 x) {
  const EmitterView& emitter = scene.emitters[lamp.index];
  if (lamp.sky == ChosenLamp::Sky::no) return sampleLight(scene, emitter, x, lamp.u);
  const Vec3 w = lamp.sky == ChosenLamp::Sky::even ? uniformSphere(lamp.u) : emitter.environment.sample(lamp.u).w;
  const float pdf = 0.5f * (environmentPdf(emitter, w) + kInv4Pi);
  return {w, kInfinity, environmentRadiance(emitter, w), pdf, false};
}

/// By power, as one of `count` points.
VIRGA_HD inline ChosenLamp chooseLamp(const SceneView& scene, float choice, Vec2 u, int count) {
  if (!scene.hasLamps()) return {};
  const auto chosen = scene.emitterChoice.sample(choice);
  return {chosen.index, chosen.probability * static_cast<float>(count), u};
}

/// Fog is lit by points of these lamps, and by angle as seen from them: LampPackets.
VIRGA_HD inline bool isAimedAt(const EmitterView& e) {
  return e.kind == EmitterView::Kind::point || e.kind == EmitterView::Kind::area;
}

/// Lights from all around.
VIRGA_HD inline bool isSky(const EmitterView& e) { return e.infinite() && !e.isDelta(); }

/// Drawn anew in each sample (`fast`): one group, of any lamps.
struct RandomNumbers {
  static constexpr int kPlaces = 4;

  Sampler& sampler;

  VIRGA_HD float shift() { return sampler.random(); }
  VIRGA_HD int groups() const { return 1; }
  /// Points of a group that light a surface.
  VIRGA_HD int onSurface(int) const { return 1; }
  /// Points on the eye ray that each group lights.
  VIRGA_HD int places() const { return kPlaces; }
  /// The k-th of a group's `count` points, for the light at a place.
  VIRGA_HD ChosenLamp lamp(const SceneView& scene, int, int, int count, Vec3 at) {
    if (!scene.hasLamps()) return {};
    const EmitterChoice chosen = chooseEmitter(scene, at, sampler.random(), LampShares::kSkyAlone);
    return {chosen.emitter, chosen.probability * static_cast<float>(count), sampler.random2D()};
  }
};

/// Points that light each pixel of a frame: all of one lamp or, where there are too many lamps, drawn from all.
struct LampGroup {
  static constexpr int kDrawn = -1;

  int lamp = kDrawn;   ///< index of the emitter
  int points = 1;      ///< for packets; a power of two, places() at most, or 0 if packets do not know the lamp
  int onSurface = 1;   ///< for a surface that packets do not know
  bool round = false;  ///< most places see a part of the points alone: all of them light each place in media
  int chosen = -1;     ///< where its points are among those that were chosen; -1: they are an even set
};

/// The same in every pixel (`frame`): points of an even set, turned by a number of the pass. Nothing shimmers; what an
/// even set gets wrong changes slowly from pixel to pixel.
struct FixedNumbers {
  static constexpr int kMostPlaces = 8;

  uint32_t pass;
  View<LampGroup> lamps = {};
  int placesOfEach = kMostPlaces;
  View<Vec2> chosen = {};  ///< places on lamps, one behind the other

  VIRGA_HD float shift() const { return turned(0.5f, 0.6180340f); }
  /// In the pixel.
  VIRGA_HD Vec2 place() const { return {turned(0.5f, 0.7548777f), turned(0.5f, 0.5698403f)}; }

  VIRGA_HD int groups() const { return lamps.size; }
  VIRGA_HD int onSurface(int group) const { return lamps[group].onSurface; }
  VIRGA_HD int places() const { return placesOfEach; }
  VIRGA_HD ChosenLamp lamp(const SceneView& scene, int group, int k, int count, Vec3 = {}) const {
    if (const LampGroup& own = lamps[group]; own.lamp != LampGroup::kDrawn) {
      if (isSky(scene.emitters[own.lamp])) return inSky(scene, own.lamp, k, count);
      return {own.lamp, static_cast<float>(count),
              own.chosen < 0 ? placeOnLamp(k, count) : chosen[own.chosen + k % own.points]};
    }
    // Of all groups' points together, each group has every so many.
    const int all = count * groups(), number = k * groups() + group;
    return chooseLamp(scene, choiceOf(number, all), placeOnLamp(number, all), all);
  }

  /// A number of pass 0 in that of this pass, which moves `by` so much from one to the next. Steps of numbers that are
  /// used together must have no relation in whole numbers: passes would not see all that they can be together.
  VIRGA_HD float turned(float x, float by) const {
    const float y = x + by * static_cast<float>(pass % 4096u);
    return std::fmin(y - std::floor(y), 0x1.fffffep-1f);
  }

 private:
  /// Van der Corput's sequence chooses the lamp,
  VIRGA_HD float choiceOf(int k, int count) const {
    return turned(toUnitFloat(reverseBits(static_cast<uint32_t>(k))) + 0.5f / static_cast<float>(count), 0.4142136f);
  }
  /// and the additive one of the plastic number the place on it; of two or four points sets whose mean is the middle,
  /// so that no side of the lamp is preferred.
  VIRGA_HD Vec2 placeOnLamp(int k, int count) const {
    const auto n = static_cast<float>(k);
    Vec2 place(0.5f + n * 0.7548777f, 0.5f + n * 0.5698403f);
    if (count == 2) place = Vec2(0.25f + 0.5f * n, 0.25f + 0.5f * n);
    if (count == 4) place = {kFour[k % 4].x, kFour[k % 4].y};
    return {turned(place.x, 0.7320508f), turned(place.y, 0.3166248f)};
  }
  VIRGA_HD ChosenLamp inSky(const SceneView& scene, int lamp, int k, int count) const {
    const auto share = static_cast<float>(count);
    if (scene.emitters[lamp].kind == EmitterView::Kind::constant || count % 2 != 0)
      return {lamp, share, placeInSky(k, count)};
    // Passes swap the halves: places along an eye ray must see both.
    const bool even = (static_cast<uint32_t>(k) + pass) % 2 == 0;
    return {lamp, share, placeInSky(k / 2, count / 2), even ? ChosenLamp::Sky::even : ChosenLamp::Sky::bright};
  }
  /// The lattice of the golden ratio: on the sphere equal slices, one direction in each, so that surfaces of all
  /// orientations get about as much light. Neighbours are far apart in k: places along an eye ray are not in step with
  /// directions.
  VIRGA_HD Vec2 placeInSky(int k, int count) const {
    const auto n = static_cast<float>(5 * k % count);
    return {turned((n + 0.5f) / static_cast<float>(count), 0.7320508f), turned(n * 0.6180340f, 0.3166248f)};
  }
  static constexpr struct {
    float x, y;
  } kFour[4] = {{0.375f, 0.125f}, {0.875f, 0.875f}, {0.125f, 0.625f}, {0.625f, 0.375f}};
};

}  // namespace virga
