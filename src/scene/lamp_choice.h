// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene_view.h"

namespace virga {

// Which lamp is asked for its light: by what each would send to a place, were nothing in the way.
// docs/decisions/lamp-choice.md

/// One of the scene's emitters, drawn at random.
struct EmitterChoice {
  int emitter = -1;
  float probability = 0;

  VIRGA_HD bool drawn() const { return emitter >= 0; }
};

/// The emitters' shares of the light at p. Where there are more than kMost of them, or only one, they are chosen by
/// power, the same everywhere.
struct LampShares {
  static constexpr int kMost = 16;
  static constexpr float kEven = 0.25f;  ///< of the draws are even: what is in the way is not known

  VIRGA_HD static bool usable(const SceneView& scene) { return scene.lamps.size > 1 && scene.lamps.size <= kMost; }

  /// How often a sky is asked whose light is met by scattered directions as well; by itself it has to be asked more.
  static constexpr float kSkyIsMet = 1, kSkyAlone = 4;

  VIRGA_HD LampShares(const SceneView& scene, Vec3 p, float sky) {
    for (int i = 0; i < scene.lamps.size; ++i) {
      light[i] = scene.lamps[i].lightAt(p) * (scene.lamps[i].sky ? sky : 1);
      sum += light[i];
      shining += scene.lamps[i].strength > 0;
    }
  }
  VIRGA_HD float probability(const SceneView& scene, int i) const {
    const float even = scene.lamps[i].strength > 0 ? 1 / static_cast<float>(shining) : 0;
    return sum > 0 ? lerp(light[i] / sum, even, kEven) : even;
  }

  float light[kMost];
  float sum = 0;
  int shining = 0;
};

/// For the light at p. The scene must have lamps.
VIRGA_HD inline EmitterChoice chooseEmitter(const SceneView& scene, Vec3 p, float u,
                                            float sky = LampShares::kSkyIsMet) {
  if (!LampShares::usable(scene)) {
    const auto choice = scene.emitterChoice.sample(u);
    return {choice.index, choice.probability};
  }
  const LampShares shares(scene, p, sky);
  EmitterChoice chosen;
  for (int i = 0; i < scene.lamps.size; ++i) {
    const float share = shares.probability(scene, i);
    if (!(share > 0)) continue;
    chosen = {i, share};
    if (u < share) break;
    u -= share;
  }
  return chosen;
}

/// With which chooseEmitter() takes this one, whose light is met by scattered directions if it is a sky.
VIRGA_HD inline float emitterProbability(const SceneView& scene, Vec3 p, int emitter) {
  if (!LampShares::usable(scene)) return scene.emitterChoice.probability(emitter);
  return LampShares(scene, p, LampShares::kSkyIsMet).probability(scene, emitter);
}

}  // namespace virga
