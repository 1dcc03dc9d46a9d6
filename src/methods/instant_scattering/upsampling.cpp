// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/upsampling.h"

#include <cmath>

#include "core/parallel.h"

namespace virga {
namespace {

/// Features that differ by so much (relative distances, cosines) agree by exp(-1/2).
constexpr float kDepthWidth = 0.05f, kNormalWidth = 0.1f, kMediaDepthWidth = 0.1f, kOpacityWidth = 0.3f;
/// A pixel of which the filter knows less than this is computed itself.
constexpr float kLeastAgreement = 0.02f;
/// What is seen by less than this share needs no care.
constexpr float kFaint = 2e-3f;

float bell(float x, float y) { return std::exp(-0.5f * (x * x + y * y)); }

/// Cubic B-spline at the four knots around the place t in [0, 1) between the middle two.
std::array<float, 4> spline(float t) {
  const float s = 1 - t;
  return {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6, t * t * t / 6};
}

float surfacesAgree(const PixelFeatures& a, const PixelFeatures& b) {
  if (std::isinf(a.depth) || std::isinf(b.depth)) return 0;
  const Vec3 way = b.p - a.p;
  const float off = std::max(std::fabs(dot(way, a.normal)), std::fabs(dot(way, b.normal)));
  return bell(off / (kDepthWidth * std::min(a.depth, b.depth)), (1 - dot(a.normal, b.normal)) / kNormalWidth);
}

float mediaAgree(const PixelFeatures& a, const PixelFeatures& b) {
  const float least = std::min(a.mediaDepth, b.mediaDepth);
  if (!(least > 0)) return 0;
  return bell((a.mediaDepth - b.mediaDepth) / (kMediaDepthWidth * least),
              (mean(a.opacity) - mean(b.opacity)) / kOpacityWidth);
}

/// Sum of weight * light over the sum of weight * veil, seen through the pixel's own veil.
template <class LightOf, class VeilOf>
std::array<Rgb, 2> filter(const float* weights, int count, Rgb veil, const LightOf& light, const VeilOf& veilOf) {
  std::array<Rgb, 2> sum{};
  Rgb through;
  for (int i = 0; i < count; ++i) {
    if (!(weights[i] > 0)) continue;
    through += veilOf(i) * weights[i];
    for (size_t l = 0; l < 2; ++l) sum[l] += light(i)[l] * weights[i];
  }
  for (Rgb& s : sum)
    for (int c = 0; c < 3; ++c) s[c] = through[c] > 0 ? s[c] * veil[c] / through[c] : 0;
  return sum;
}

}  // namespace

Upsampling::Upsampling(std::vector<PixelFeatures> features, int width, int height, int spacing)
    : features_(std::move(features)),
      width_(width),
      height_(height),
      spacing_(spacing),
      columns_((width + spacing - 1) / spacing),
      rows_((height + spacing - 1) / spacing) {
  own_.assign(features_.size(), kFiltered);
  const auto compute = [&](int x, int y) {
    own_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)] =
        static_cast<uint32_t>(computed_.size());
    computed_.push_back({x, y});
  };
  for (int j = 0; j < rows_; ++j)
    for (int i = 0; i < columns_; ++i)
      compute(std::min(i * spacing + spacing / 2, width - 1), std::min(j * spacing + spacing / 2, height - 1));
  std::vector<uint8_t> needed(features_.size());
  parallelFor(height, 4, [&](int64_t y) {
    for (int x = 0; x < width; ++x)
      needed[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)] =
          needsOwn(x, static_cast<int>(y));
  });
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (needed[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)]) compute(x, y);
}

int Upsampling::coarseIndex(int i, int j) const {
  return std::clamp(j, 0, rows_ - 1) * columns_ + std::clamp(i, 0, columns_ - 1);
}

Upsampling::Place Upsampling::placeOf(int x, int y) const {
  const float u = (static_cast<float>(x) - static_cast<float>(spacing_ / 2)) / static_cast<float>(spacing_);
  const float v = (static_cast<float>(y) - static_cast<float>(spacing_ / 2)) / static_cast<float>(spacing_);
  const int i0 = static_cast<int>(std::floor(u)), j0 = static_cast<int>(std::floor(v));
  return {i0 - 1, j0 - 1, spline(u - static_cast<float>(i0)), spline(v - static_cast<float>(j0))};
}

void Upsampling::addTap(const PixelFeatures& here, const Place& place, int tap, Weights& w) const {
  const int a = tap % kTaps, b = tap / kTaps;
  const Pixel& p = computed_[static_cast<size_t>(coarseIndex(place.i + a, place.j + b))];
  const PixelFeatures& there = features(p.x, p.y);
  const float s = there.regular ? place.wx[static_cast<size_t>(a)] * place.wy[static_cast<size_t>(b)] : 0;
  const bool seesSurface = maxComponent(here.surface) > 0, seesMedia = maxComponent(here.opacity) > 0;
  w.surfaceSum += w.surface[tap] = s > 0 && seesSurface ? s * surfacesAgree(here, there) : 0;
  w.mediaSum += w.media[tap] = s > 0 && seesMedia ? s * mediaAgree(here, there) : 0;
}

bool Upsampling::needsOwn(int x, int y) const {
  if (own_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)] != kFiltered) return false;
  const PixelFeatures& f = features(x, y);
  if (!f.regular) return true;
  const bool surface = maxComponent(f.surface) > kFaint, media = maxComponent(f.opacity) > kFaint;
  const Place place = placeOf(x, y);
  Weights w;
  // The nearest ones first: they are mostly enough.
  for (const int tap : {5, 6, 9, 10, 1, 2, 4, 7, 8, 11, 13, 14, 0, 3, 12, 15}) {
    if ((!surface || w.surfaceSum >= kLeastAgreement) && (!media || w.mediaSum >= kLeastAgreement)) return false;
    addTap(f, place, tap, w);
  }
  return (surface && w.surfaceSum < kLeastAgreement) || (media && w.mediaSum < kLeastAgreement);
}

Upsampling::Light Upsampling::at(const std::vector<Light>& computed, int x, int y) const {
  const uint32_t own = own_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  const bool coarse = own < static_cast<uint32_t>(columns_ * rows_);
  const PixelFeatures& here = features(x, y);
  if (own != kFiltered && (!coarse || !here.regular)) return computed[own];
  const Place place = placeOf(x, y);
  Weights w;
  for (int tap = 0; tap < kTaps * kTaps; ++tap) addTap(here, place, tap, w);
  const auto index = [&](int tap) {
    return static_cast<size_t>(coarseIndex(place.i + tap % kTaps, place.j + tap / kTaps));
  };
  const auto featuresOf = [&](int tap) -> const PixelFeatures& {
    const Pixel& p = computed_[index(tap)];
    return features(p.x, p.y);
  };
  Light light;
  light.surface = filter(
      w.surface, kTaps * kTaps, here.surface, [&](int tap) { return computed[index(tap)].surface; },
      [&](int tap) { return featuresOf(tap).surface; });
  light.media = filter(
      w.media, kTaps * kTaps, here.opacity, [&](int tap) { return computed[index(tap)].media; },
      [&](int tap) { return featuresOf(tap).opacity; });
  return light;
}

}  // namespace virga
