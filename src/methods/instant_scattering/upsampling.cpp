// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/upsampling.h"

#include <cmath>

namespace virga {
namespace {

/// A pixel of which the filter knows less than this is computed itself.
constexpr float kLeastAgreement = 0.02f;

/// Cubic B-spline at the four knots around the place t in [0, 1) between the middle two.
std::array<float, 4> spline(float t) {
  const float s = 1 - t;
  return {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6, t * t * t / 6};
}

float finiteDepth(const PixelFeatures& f) { return std::isinf(f.depth) ? 0 : f.depth; }

UpsamplingTap tapOf(const PixelFeatures& f) {
  UpsamplingTap tap{};
  tap.px = f.p.x, tap.py = f.p.y, tap.pz = f.p.z;
  tap.nx = f.normal.x, tap.ny = f.normal.y, tap.nz = f.normal.z;
  tap.depth = finiteDepth(f), tap.mediaDepth = f.mediaDepth, tap.opacity = mean(f.opacity);
  tap.counts = f.regular ? 1.f : 0.f;
  for (int c = 0; c < 3; ++c) tap.surfaceVeil[c] = f.surface[c], tap.mediaVeil[c] = f.opacity[c];
  return tap;
}

void set(UpsamplingBlock& b, int i, const PixelFeatures& f) {
  b.px[i] = f.p.x, b.py[i] = f.p.y, b.pz[i] = f.p.z;
  b.nx[i] = f.normal.x, b.ny[i] = f.normal.y, b.nz[i] = f.normal.z;
  b.depth[i] = finiteDepth(f), b.mediaDepth[i] = f.mediaDepth, b.opacity[i] = mean(f.opacity);
  for (int c = 0; c < 3; ++c) b.surfaceVeil[c][i] = f.surface[c], b.mediaVeil[c][i] = f.opacity[c];
}

int roundedUp(int a, int b) { return (a + b - 1) / b; }

}  // namespace

/// The taps of a block's pixels, and how they are weighted.
struct Upsampling::Filter {
  UpsamplingBlock block;
  UpsamplingWeights weights;
  const UpsamplingTap* taps[UpsamplingBlock::kTaps];

  Filter(const Upsampling& u, const PixelBlock& pixels, const std::vector<UpsamplingTap>& all) {
    constexpr int kVector = 16;
    block.count = roundedUp(pixels.count, kVector) * kVector;
    for (int i = 0; i < block.count; ++i) {
      const auto [x, y] = pixels.pixel[std::min(i, pixels.count - 1)];
      set(block, i, u.features_[u.numberOf(x, y)]);
      const auto wx = u.splineAt(x - u.columns_.cell(pixels.column)), wy = u.splineAt(y - u.rows_.cell(pixels.row));
      for (size_t k = 0; k < 4; ++k) block.wx[k][i] = wx[k], block.wy[k][i] = wy[k];
    }
    for (int tap = 0; tap < UpsamplingBlock::kTaps; ++tap) {
      const int column = std::clamp(pixels.column - 1 + tap % 4, 0, u.columns_.count() - 1);
      const int row = std::clamp(pixels.row - 1 + tap / 4, 0, u.rows_.count() - 1);
      taps[tap] = &all[static_cast<size_t>(row * u.columns_.count() + column)];
    }
    weighTaps(block, taps, weights);
  }
};

CoarseAxis::CoarseAxis(int size, int spacing, int place) : size_(size), spacing_(spacing) {
  first_ = ((place % spacing) + spacing) % spacing;
  if (first_ > spacing / 2) first_ -= spacing;
  count_ = (size - 1 + spacing / 2 - first_) / spacing + 1;
}

Upsampling::Upsampling(std::span<const PixelFeatures> features, int width, int height, int spacing, Pixel place)
    : features_(features),
      width_(width),
      height_(height),
      spacing_(spacing),
      columns_(width, spacing, place.x),
      rows_(height, spacing, place.y),
      blocksPerCell_(roundedUp(spacing, UpsamplingBlock::kEdge)),
      blocksAcross_((columns_.count() + 1) * blocksPerCell_),
      blocksDown_((rows_.count() + 1) * blocksPerCell_) {
  for (int t = 0; t < spacing; ++t) splines_.push_back(spline(static_cast<float>(t) / static_cast<float>(spacing)));
  for (int j = 0; j < rows_.count(); ++j)
    for (int i = 0; i < columns_.count(); ++i) coarse_.push_back({columns_.at(i), rows_.at(j)});
}

std::vector<Upsampling::Pixel> Upsampling::joined(const std::vector<std::vector<Pixel>>& lists) {
  std::vector<Pixel> all;
  for (const std::vector<Pixel>& list : lists) all.insert(all.end(), list.begin(), list.end());
  return all;
}

bool Upsampling::needsOwn(const PixelFeatures& f, float surfaceSum, float mediaSum) const {
  if (!f.regular) return true;
  return (maxComponent(f.surface) > Upsampling::kFaint && surfaceSum < kLeastAgreement) ||
         (maxComponent(f.opacity) > Upsampling::kFaint && mediaSum < kLeastAgreement);
}

Upsampling::PixelBlock Upsampling::blockOf(int64_t n) const {
  const int across = static_cast<int>(n % blocksAcross_), down = static_cast<int>(n / blocksAcross_);
  PixelBlock block;
  block.column = across / blocksPerCell_ - 1, block.row = down / blocksPerCell_ - 1;
  // A cell begins at its coarse pixel.
  const auto within = [&](const CoarseAxis& axis, int cell, int part, int size, int& begin, int& end) {
    const int own = axis.cell(cell) + part * UpsamplingBlock::kEdge;
    begin = std::max(0, own);
    end = std::min({size, axis.cell(cell + 1), own + UpsamplingBlock::kEdge});
  };
  int x0, x1, y0, y1;
  within(columns_, block.column, across % blocksPerCell_, width_, x0, x1);
  within(rows_, block.row, down % blocksPerCell_, height_, y0, y1);
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) block.pixel[block.count++] = {x, y};
  return block;
}

std::vector<UpsamplingTap> Upsampling::tapsOf(std::span<const Light> light) const {
  std::vector<UpsamplingTap> taps;
  for (size_t n = 0; n < coarse_.size(); ++n) {
    UpsamplingTap& tap = taps.emplace_back(tapOf(features_[numberOf(coarse_[n].x, coarse_[n].y)]));
    for (size_t l = 0; l < 2; ++l)
      for (int c = 0; c < 3; ++c) tap.surface[l][c] = light[n].surface[l][c], tap.media[l][c] = light[n].media[l][c];
  }
  return taps;
}

void Upsampling::lightBlock(const PixelBlock& pixels, const std::vector<UpsamplingTap>& all, BlockLight& light) const {
  const Filter filter(*this, pixels, all);
  for (int i = 0; i < pixels.count; ++i) {
    const PixelFeatures& own = features_[numberOf(pixels.pixel[i].x, pixels.pixel[i].y)];
    light.known[i] = !needsOwn(own, filter.weights.surfaceSum[i], filter.weights.mediaSum[i]);
  }
  spreadLight(filter.block, filter.taps, filter.weights, light.filtered);
}

Upsampling::Pixel coarsePlace(const PerspectiveCamera& camera, int spacing, uint32_t pass) {
  // The additive sequence of the plastic number.
  const auto moved = [&](double step) {
    const double x = step * pass;
    return static_cast<int>((x - std::floor(x)) * spacing);
  };
  return {spacing / 2 + moved(0.7548776662) - camera.cropX, spacing / 2 + moved(0.5698402910) - camera.cropY};
}

}  // namespace virga
