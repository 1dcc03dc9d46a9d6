// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/pixel_features.h"

#include "core/random.h"

namespace virga {

EyeStart middleOf(const Scene& scene, int x, int y) {
  return {scene.camera.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f),
          toUnitFloat(hash32(scene.camera.pixelStream(x, y)))};
}

}  // namespace virga
