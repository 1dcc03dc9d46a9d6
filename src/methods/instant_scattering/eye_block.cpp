// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/eye_block.h"

namespace virga {

void EyeBlock::march(const SceneView& scene, const EmbreeRays& rays, int steps, bool packs,
                     std::span<const EyeStart> starts) {
  RayPacket packet;
  for (size_t i = 0; i < count; ++i) packet.set(static_cast<int>(i), starts[i].camera.ray, starts[i].camera.tMax);
  const PacketHits hits = rays.surfaces.nearest(packet);
  smoke_.clear();
  for (size_t i = 0; i < count; ++i) meet(scene, rays, steps, packs, i, starts[i], hits[i]);
  smoke_.march();
  for (size_t i = 0; i < count; ++i)
    if (smoke_.has(i)) eyes_[i].depth = smoke_.depth(i);
}

void EyeBlock::meet(const SceneView& scene, const EmbreeRays& rays, int steps, bool packs, size_t i,
                    const EyeStart& start, const RayHit& hit) {
  MarchedEye& eye = eyes_[i];
  bool more = false;
  walkEye(scene, rays, start.camera, hit, eye, [&](float t0, float t1) {
    more = smoke_.has(i);
    if (more) return false;
    if (packs && eye.steps == 0 && smoke_.add(scene, i, eye.at.ray, eye.at.media, t0, t1, steps, start.shift)) {
      eye.media[0] = eye.at.media;
      return true;
    }
    return marchStretch(scene, eye, t0, t1, start.shift, steps);
  });
  if (!more) return;
  smoke_.remove(i);
  marchEye(scene, rays, start.camera, hit, start.shift, eye, steps);
}

}  // namespace virga
