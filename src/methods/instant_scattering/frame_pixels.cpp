// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/frame_pixels.h"

namespace virga {

CameraRay FramePixels::cameraRay(int x, int y) const {
  return scene_.camera.ray(static_cast<float>(x) + 0.5f + offset_.x, static_cast<float>(y) + 0.5f + offset_.y);
}

void FramePixels::direct(EyeBlock& block) const {
  block.look(scene_.view, rays_, options_.eyeSteps, packets_.lightSmoke(), [&](EyeBlock::Pixel p) {
    return EyeStart{cameraRay(p.x, p.y), numbers_.shift()};
  });
  const std::span radiance = std::span(block.radiance).first(block.count);
  std::fill(radiance.begin(), radiance.end(), LayerRadiance());
  packets_.add(block.eyes(), block.smoke(), radiance);
}

template <class Visit>
void FramePixels::visitReceivers(const MarchedEye& eye, Visit&& visit) const {
  const Vec3 wo = -eye.at.ray.d;
  const float share = 1 / static_cast<float>(options_.samples);
  eye.visitPoints(options_.samples, numbers_.shift(), [&](int, Vec3 p, Rgb weight, const MediaState& media) {
    Rgb sigmaT;
    for (int i = 0; i < media.count(); ++i) sigmaT += scene_.view.media[media.medium(i)].sigmaTAt(p);
    for (int i = 0; i < media.count(); ++i) {
      Receiver r{Vertex::inMedium(scene_.view, media.medium(i), p, wo, media), weight * share};
      const Rgb own = scene_.view.media[media.medium(i)].sigmaTAt(p);
      for (int c = 0; c < 3; ++c) r.throughput[c] *= sigmaT[c] > 0 ? own[c] / sigmaT[c] : 0;
      visit(std::move(r));
    }
  });
  if (eye.hit.found()) visit({Vertex::onSurface(eye.point, eye.side, wo, eye.at.media), transmittanceOf(eye.depth)});
}

NearbyNumbers FramePixels::nearbyNumbers(Pixel p, int receiver) const {
  // Coarse pixels of a square of 4 x 4, which the filter spans, look in different directions.
  const int x = (p.x + scene_.camera.cropX) / options_.spacing % 4,
            y = (p.y + scene_.camera.cropY) / options_.spacing % 4;
  const int most = options_.samples + 1;  // receivers of a pixel; the next pass goes on behind them
  const auto n = static_cast<float>((4 * y + x) * most + receiver);
  const auto u = [&](float start, float step) {
    return numbers_.turned(start + step * n, step * static_cast<float>(16 * most));
  };
  // Additive sequence of the generalised golden ratio in six dimensions.
  return {{u(0.5f, 0.8986537f), u(0.5f, 0.8075785f)},
          u(0.5f, 0.7257334f),
          {u(0.5f, 0.6521830f), u(0.5f, 0.5860866f)},
          u(0.5f, 0.5266889f)};
}

bool FramePixels::findNearby(const Receiver& from, Pixel pixel, int number, Receiver& next) const {
  const NearbyVertex<EmbreeRays> nearby{scene_.view, rays_, 1 / std::sqrt(options_.frame.near.bound),
                                        options_.frame.near.bound};
  const auto seen = [&](MediaRay& r, float end, float) {
    constexpr int kSteps = 8;
    Rgb depth;
    walkMedia(scene_.view, rays_, r, end, [&](float t0, float t1) {
      return marchMedia(scene_.view, r.media, r.ray, t0, t1, kSteps, numbers_.shift(), [&](float, float, Rgb here) {
        depth += here;
        return true;
      });
    });
    return transmittanceOf(depth);
  };
  next.pixel = from.pixel, next.x1 = from.vertex.kind;
  return nearby.find(
      from.vertex, from.throughput, nearbyNumbers(pixel, number), [](Vec3, float) { return false; }, seen, next.vertex,
      next.throughput);
}

std::vector<std::optional<Upsampling::Light>> FramePixels::indirect(std::span<const Pixel> pixels) const {
  ReceiverBatch batch, nearby;
  std::vector<std::optional<Upsampling::Light>> light(pixels.size());
  for (size_t n = 0; n < pixels.size(); ++n) {
    MarchedEye eye;
    marchEye(scene_.view, rays_, cameraRay(pixels[n].x, pixels[n].y), numbers_.shift(), eye, options_.eyeSteps);
    if (!eye.plain) continue;
    light[n].emplace();
    int number = 0;
    visitReceivers(eye, [&](Receiver r) {
      r.pixel = static_cast<int>(n);
      batch.add(scene_.view, r);
      Receiver next;
      if (options_.compensate == ImsOptions::Compensate::sampled && findNearby(r, pixels[n], number++, next))
        nearby.add(scene_.view, next);
    });
  }
  const auto found = [&](int pixel, VertexKind x1, VertexKind x2, Rgb more) {
    Upsampling::Light& l = *light[static_cast<size_t>(pixel)];
    (x1 == VertexKind::surface ? l.surface : l.media)[x2 == VertexKind::medium] += more;
  };
  batch.gather(scene_, lights_, options_.frame, found);
  if (options_.compensate == ImsOptions::Compensate::sampled) {
    ReceiverBatch::Options reduced = options_.frame;
    reduced.near.bound *= CompensationOptions::kReducedClamping;
    nearby.gather(scene_, lights_, reduced, found);
  }
  return light;
}

}  // namespace virga
