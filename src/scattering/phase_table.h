// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "core/distribution.h"
#include "scattering/phase_functions.h"

namespace virga {

/// A function of the scattering cosine given by numbers, linear between them; a view of a PhaseTable. Sampling is
/// exact.
struct TabulatedPhase {
  const float* values = nullptr;  ///< [1/sr] at cosines -1 (backward), ..., 1 (forward), evenly spaced
  DiscreteView pieces;            ///< the intervals between them

  VIRGA_HD float value(Vec3 wo, Vec3 wi) const {
    const float x = clamp(0.5f * (1 - dot(wo, wi)), 0.f, 1.f) * static_cast<float>(pieces.count);
    const int i = std::min(static_cast<int>(x), pieces.count - 1);
    return between(i, x - static_cast<float>(i));
  }
  VIRGA_HD float pdf(Vec3 wo, Vec3 wi) const { return value(wo, wi); }
  VIRGA_HD PhaseSample sample(Vec3 wo, Vec2 u) const {
    const DiscreteView::Sample piece = pieces.sample(u.x);
    const float t = inverse(values[piece.index], values[piece.index + 1], piece.remapped);
    // From the nearer end: 1 - c keeps its digits where c rounds to 1.
    const float x = static_cast<float>(piece.index) + t, rest = static_cast<float>(pieces.count - piece.index) - t;
    const float step = 2 / static_cast<float>(pieces.count), up = x * step, down = rest * step;
    const float c = up < down ? up - 1 : 1 - down;
    const Vec3 wi = Frame(-wo).toWorld(sphericalDirection(std::sqrt(up * down), c, kTwoPi * u.y));
    const float p = between(piece.index, t);
    return {wi, p, p};
  }
  friend bool operator==(const TabulatedPhase& a, const TabulatedPhase& b) { return a.values == b.values; }

 private:
  VIRGA_HD float between(int i, float t) const { return values[i] * (1 - t) + values[i + 1] * t; }

  /// Where the integral of a function that goes from a at 0 to b at 1 reaches the share u of its whole. Never at an end
  /// where the function is 0.
  VIRGA_HD static float inverse(float a, float b, float u) {
    const float share = clamp(u, 0x1p-24f, 1 - 0x1p-24f), largest = std::max(a, b);
    const float from = a / largest, to = b / largest;
    return share * (from + to) / (from + std::sqrt(from * from * (1 - share) + to * to * share));
  }
};

/// Owner of a TabulatedPhase.
class PhaseTable {
 public:
  /// Two or more values in any unit, finite, not negative, not all 0.
  explicit PhaseTable(std::span<const float> values) : values_(values.begin(), values.end()) {
    std::vector<double> areas;
    for (size_t i = 1; i < values.size(); ++i)
      areas.push_back(0.5 * (static_cast<double>(values[i - 1]) + static_cast<double>(values[i])));
    const double largest = *std::max_element(areas.begin(), areas.end());
    std::vector<float> weights;
    for (const double a : areas) weights.push_back(static_cast<float>(a / largest));
    pieces_ = Discrete(weights);
    const double integral = pieces_.total() * largest * 2 / static_cast<double>(areas.size());  // over the cosine
    for (float& v : values_) v = static_cast<float>(static_cast<double>(v) / (2 * kPiDouble * integral));
  }

  TabulatedPhase view() const { return {values_.data(), pieces_.view()}; }
  friend bool operator==(const PhaseTable& a, const PhaseTable& b) { return a.values_ == b.values_; }

 private:
  static constexpr double kPiDouble = 3.14159265358979323846;
  std::vector<float> values_;
  Discrete pieces_;
};

}  // namespace virga
