// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/light_choice.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/transform.h"

namespace virga {
namespace {

/// How far a light's importance may be from its weight, as a factor, before it follows.
constexpr double kDrift = 2;

/// A place on a curve that fills the box (Morton 1966): neighbours on it are neighbours in space.
uint64_t placeOnCurve(Vec3 p, const Bounds& box) {
  constexpr int kBits = 12;
  uint64_t code = 0;
  uint32_t cell[3];
  for (int axis = 0; axis < 3; ++axis) {
    const float extent = box.extent()[axis];
    const float share = extent > 0 ? (p[axis] - box.lo[axis]) / extent : 0;
    cell[axis] = static_cast<uint32_t>(clamp(share, 0, 1) * ((1 << kBits) - 1));
  }
  for (int bit = kBits - 1; bit >= 0; --bit)
    for (const uint32_t c : cell) code = code << 1 | (c >> bit & 1u);
  return code;
}

std::vector<size_t> alongCurve(std::span<const LightChoice::Candidate> candidates) {
  Bounds box;
  for (const auto& c : candidates) box.extend(c.p);
  std::vector<std::pair<uint64_t, size_t>> places;
  for (size_t i = 0; i < candidates.size(); ++i) places.emplace_back(placeOnCurve(candidates[i].p, box), i);
  std::sort(places.begin(), places.end());
  std::vector<size_t> order;
  for (const auto& [place, i] : places) order.push_back(i);
  return order;
}

}  // namespace

std::vector<LightChoice::Chosen> LightChoice::choose(std::span<const Candidate> candidates, size_t most, float turn) {
  std::vector<Chosen> chosen;
  if (candidates.size() <= most) {
    for (size_t i = 0; i < candidates.size(); ++i) chosen.push_back({i, 1});
    known_.clear();
    return chosen;
  }
  constexpr double kNew = -1;  // has no place yet
  std::vector<Known> now;
  double total = 0;
  size_t before = 0;
  for (const Candidate& c : candidates) {
    const auto weight = static_cast<double>(c.weight);
    while (before < known_.size() && known_[before].name < c.name) ++before;
    if (before < known_.size() && known_[before].name == c.name)
      now.push_back(
          {c.name, std::clamp(known_[before].importance, weight / kDrift, weight * kDrift), known_[before].place});
    else
      now.push_back({c.name, weight, kNew});
    total += now.back().importance;
  }
  const double step = total / static_cast<double>(most);
  double sum = 0, next = step * (ahead_ < 0 ? static_cast<double>(turn) : ahead_);
  for (const size_t i : alongCurve(candidates)) {
    Known& light = now[i];
    double stands = 0;
    if (light.place == kNew) {
      light.place = (next - sum) / step;
      sum += light.importance;
      for (; next < sum; next += step) stands += step;
    } else {
      stands = step * std::max(0., std::ceil(light.importance / step - light.place));
    }
    if (stands > 0) chosen.push_back({i, static_cast<float>(stands / light.importance)});
  }
  ahead_ = (next - sum) / step;
  known_ = std::move(now);
  return chosen;
}

}  // namespace virga
