// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/ims_pixels.h"

namespace virga {

void ImsPixels::light(EyeBlock& block, std::span<Sampler> samplers) const {
  lightSmoke(block, samplers);
  for (size_t i = 0; i < block.count; ++i) {
    const MarchedEye& eye = block.eyes()[i];
    if (!eye.plain) continue;
    RandomNumbers numbers{samplers[i]};
    if (block.smoke().has(i))
      paths_.marched().addBesideMedia(eye, block.radiance[i], numbers);
    else
      paths_.marched().add(eye, block.radiance[i], numbers);
  }
}

void ImsPixels::lightSmoke(EyeBlock& block, std::span<Sampler> samplers) const {
  const EyePacket& smoke = block.smoke();
  if (smoke.empty() || smoke.eyes().from > smoke.eyes().to) return;
  const auto lit = [&](size_t i) { return smoke.has(i) && block.eyes()[i].plain && smoke.depths().opacity[i] > 0; };
  float shift[EyeBlock::kSize] = {};
  for (size_t i = 0; i < block.count; ++i)
    if (lit(i)) shift[i] = RandomNumbers{samplers[i]}.shift();
  constexpr int kPoints = RandomNumbers::kPlaces;
  for (int k = 0; k < kPoints; ++k) {
    alignas(64) float place[EyeBlock::kSize];
    for (size_t i = 0; i < EyeBlock::kSize; ++i)
      place[i] = std::fmin((static_cast<float>(k) + shift[i]) / kPoints, 0x1.fffffep-1f);
    EyePoints at;
    placePoints(smoke.eyes(), smoke.depths(), place, at);
    for (size_t i = 0; i < block.count; ++i) {
      if (!lit(i)) continue;
      RandomNumbers numbers{samplers[i]};
      const Vec3 p(at.px[i], at.py[i], at.pz[i]);
      const ChosenLamp lamp = numbers.lamp(scene_.view, 0, k, kPoints, p);
      if (!(lamp.chance > 0)) continue;
      const MarchedEye& eye = block.eyes()[i];
      paths_.marched().lightPoint(eye, lamp, p, Rgb(at.weight[0][i], at.weight[1][i], at.weight[2][i]), eye.media[0],
                                  block.radiance[i], numbers);
    }
  }
}

}  // namespace virga
