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

Upsampling::Weights Upsampling::weights(int x, int y) const {
  const PixelFeatures& here = features(x, y);
  const float u = (static_cast<float>(x) - static_cast<float>(spacing_ / 2)) / static_cast<float>(spacing_);
  const float v = (static_cast<float>(y) - static_cast<float>(spacing_ / 2)) / static_cast<float>(spacing_);
  const int i0 = static_cast<int>(std::floor(u)), j0 = static_cast<int>(std::floor(v));
  const auto wx = spline(u - static_cast<float>(i0)), wy = spline(v - static_cast<float>(j0));
  const bool seesSurface = maxComponent(here.surface) > 0, seesMedia = maxComponent(here.opacity) > 0;
  Weights w;
  for (int b = 0; b < kTaps; ++b)
    for (int a = 0; a < kTaps; ++a) {
      const Pixel& p = computed_[static_cast<size_t>(coarseIndex(i0 - 1 + a, j0 - 1 + b))];
      const PixelFeatures& there = features(p.x, p.y);
      const float s = there.regular ? wx[static_cast<size_t>(a)] * wy[static_cast<size_t>(b)] : 0;
      const int tap = b * kTaps + a;
      w.surfaceSum += w.surface[tap] = s > 0 && seesSurface ? s * surfacesAgree(here, there) : 0;
      w.mediaSum += w.media[tap] = s > 0 && seesMedia ? s * mediaAgree(here, there) : 0;
    }
  return w;
}

bool Upsampling::needsOwn(int x, int y) const {
  if (own_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)] != kFiltered) return false;
  const PixelFeatures& f = features(x, y);
  if (!f.regular) return true;
  const Weights w = weights(x, y);
  return (maxComponent(f.surface) > kFaint && w.surfaceSum < kLeastAgreement) ||
         (maxComponent(f.opacity) > kFaint && w.mediaSum < kLeastAgreement);
}

Upsampling::Light Upsampling::at(const std::vector<Light>& computed, int x, int y) const {
  const uint32_t own = own_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  const bool coarse = own < static_cast<uint32_t>(columns_ * rows_);
  const PixelFeatures& here = features(x, y);
  if (own != kFiltered && (!coarse || !here.regular)) return computed[own];
  const Weights w = weights(x, y);
  const float u = (static_cast<float>(x) - static_cast<float>(spacing_ / 2)) / static_cast<float>(spacing_);
  const float v = (static_cast<float>(y) - static_cast<float>(spacing_ / 2)) / static_cast<float>(spacing_);
  const int i0 = static_cast<int>(std::floor(u)) - 1, j0 = static_cast<int>(std::floor(v)) - 1;
  const auto index = [&](int tap) { return static_cast<size_t>(coarseIndex(i0 + tap % kTaps, j0 + tap / kTaps)); };
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
