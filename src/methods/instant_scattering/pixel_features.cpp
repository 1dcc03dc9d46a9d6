// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/pixel_features.h"

#include "core/random.h"

namespace virga {

void marchMiddle(const Scene& scene, int x, int y, int steps, MarchedEye& eye) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const float shift = toUnitFloat(hash32(scene.camera.pixelStream(x, y)));
  const CameraRay camera = scene.camera.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  marchEye(scene.view, rays, camera, shift, eye, steps);
}

PixelFeatures pixelFeatures(const Scene& scene, int x, int y, int steps) {
  MarchedEye eye;
  marchMiddle(scene, x, y, steps, eye);
  return pixelFeatures(eye);
}

}  // namespace virga
