// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/lamp_places.h"

#include <algorithm>
#include <cmath>

namespace virga {

LampPlaces::LampPlaces(const SceneView& scene, const EmitterView& emitter, int count, uint32_t pass) {
  // More places than are chosen from tell of the lamp as a whole.
  constexpr int kOfLamp = 1024;
  const auto sets = static_cast<uint32_t>(kPlaces / count);
  const FixedNumbers numbers{pass / sets};
  std::vector<LightPoint> points;
  Bounds bounds;
  for (int n = 0; n < kOfLamp; ++n) {
    points.push_back(sampleLightPoint(scene, emitter, evenPlace(n, numbers)));
    bounds.extend(points.back().p);
    facesApart_ = facesApart_ || dot(points.back().normal, points.front().normal) < 0;
  }
  const float size = std::max(1e-30f, 0.5f * maxComponent(bounds.extent()));
  Features mean{};
  std::vector<Place> left;
  for (int n = 0; n < kOfLamp; ++n) {
    const LightPoint& point = points[static_cast<size_t>(n)];
    const Features features = featuresOf((point.p - bounds.center()) / size, point.normal);
    for (size_t f = 0; f < mean.size(); ++f) mean[f] += features[f] / kOfLamp;
    if (n < kPlaces) left.push_back({evenPlace(n, numbers), features});
  }
  for (Place& place : left)
    for (size_t f = 0; f < mean.size(); ++f) place.off[f] -= mean[f];
  const auto each = static_cast<size_t>(count);
  for (uint32_t set = 0;; ++set) {
    balance(left, each);
    if (set == pass % sets) break;
    left.erase(left.begin(), left.begin() + count);
  }
  for (size_t k = 0; k < each; ++k) places_.push_back(left[k].u);
}

Vec2 LampPlaces::evenPlace(int n, const FixedNumbers& numbers) {
  const auto x = static_cast<float>(n);
  return {numbers.turned(0.5f + x * 0.7548777f, 0.7320508f), numbers.turned(0.5f + x * 0.5698403f, 0.2360680f)};
}

LampPlaces::Features LampPlaces::featuresOf(Vec3 p, Vec3 normal) {
  static const std::array<Vec3, kDirections> directions = [] {
    constexpr float kGoldenAngle = 2.3999632f;
    std::array<Vec3, kDirections> even;
    for (size_t d = 0; d < even.size(); ++d) {
      const float z = 1 - (2 * static_cast<float>(d) + 1) / kDirections;
      even[d] = sphericalDirection(std::sqrt(1 - z * z), z, kGoldenAngle * static_cast<float>(d));
    }
    return even;
  }();
  Features features = {p.x, p.y, p.z, p.x * p.x, p.y * p.y, p.z * p.z, p.x * p.y, p.y * p.z, p.z * p.x};
  for (size_t d = 0; d < directions.size(); ++d) features[kMoments + d] = std::max(0.f, dot(normal, directions[d]));
  return features;
}

void LampPlaces::balance(std::vector<Place>& places, size_t count) {
  Features sum{};
  for (size_t k = 0; k < count; ++k)
    for (size_t f = 0; f < sum.size(); ++f) sum[f] += places[k].off[f];
  const auto with = [&](size_t in, size_t out) {
    float error = 0;
    for (size_t f = 0; f < sum.size(); ++f) error += square(sum[f] + places[in].off[f] - places[out].off[f]);
    return error;
  };
  float best = with(0, 0);
  for (bool improved = true; improved;) {
    improved = false;
    for (size_t k = 0; k < count; ++k)
      for (size_t i = count; i < places.size(); ++i) {
        const float error = with(i, k);
        if (!(error < 0.999f * best)) continue;
        for (size_t f = 0; f < sum.size(); ++f) sum[f] += places[i].off[f] - places[k].off[f];
        std::swap(places[i], places[k]);
        best = error, improved = true;
      }
  }
}

}  // namespace virga
