// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/light_spacing.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/octahedral.h"
#include "core/parallel.h"

namespace virga {
namespace {

/// A balanced k-d tree (Bentley 1975): of each range the middle light divides the others along its widest axis.
class NeighbourTree {
 public:
  struct Neighbour {
    float d2;
    float weight;

    bool operator<(const Neighbour& other) const { return d2 < other.d2; }
  };

  explicit NeighbourTree(std::span<const PlacedLight> lights)
      : lights_(lights.begin(), lights.end()), axes_(lights.size()) {
    divide(0, lights_.size());
  }

  /// The `most` that are nearest to p, in order.
  void nearest(Vec3 p, size_t most, std::vector<Neighbour>& found) const {
    found.clear();
    search(p, most, 0, lights_.size(), found);
    std::sort_heap(found.begin(), found.end());
  }

 private:
  void divide(size_t first, size_t last) {
    if (last - first < 2) return;
    Bounds box;
    for (size_t i = first; i < last; ++i) box.extend(lights_[i].p);
    const Vec3 e = box.extent();
    const int axis = e.x > e.y ? (e.x > e.z ? 0 : 2) : (e.y > e.z ? 1 : 2);
    const size_t middle = first + (last - first) / 2;
    const auto at = [&](size_t i) { return lights_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(first), at(middle), at(last),
                     [&](const PlacedLight& a, const PlacedLight& b) { return a.p[axis] < b.p[axis]; });
    axes_[middle] = static_cast<char>(axis);
    divide(first, middle);
    divide(middle + 1, last);
  }

  void search(Vec3 p, size_t most, size_t first, size_t last, std::vector<Neighbour>& found) const {
    if (first >= last) return;
    const size_t middle = first + (last - first) / 2;
    const PlacedLight& light = lights_[middle];
    add({lengthSquared(light.p - p), light.weight}, most, found);
    const float way = p[axes_[middle]] - light.p[axes_[middle]];
    const bool below = way < 0;
    search(p, most, below ? first : middle + 1, below ? middle : last, found);
    if (found.size() < most || way * way < found.front().d2)
      search(p, most, below ? middle + 1 : first, below ? last : middle, found);
  }

  static void add(Neighbour n, size_t most, std::vector<Neighbour>& found) {
    if (found.size() == most) {
      if (!(n < found.front())) return;
      std::pop_heap(found.begin(), found.end());
      found.back() = n;
    } else {
      found.push_back(n);
    }
    std::push_heap(found.begin(), found.end());
  }

  std::vector<PlacedLight> lights_;
  std::vector<char> axes_;
};

}  // namespace

std::vector<float> radiiOfNeighbours(std::span<const PlacedLight> lights, float times, int most, int dimensions) {
  std::vector<float> radii(lights.size());
  const NeighbourTree tree(lights);
  constexpr int64_t kGrain = 64;
  const auto count = static_cast<int64_t>(lights.size());
  parallelFor((count + kGrain - 1) / kGrain, 1, [&](int64_t group) {
    std::vector<NeighbourTree::Neighbour> found;
    for (int64_t i = group * kGrain; i < std::min(count, (group + 1) * kGrain); ++i) {
      const PlacedLight& light = lights[static_cast<size_t>(i)];
      tree.nearest(light.p, static_cast<size_t>(most), found);
      const float wanted = times * light.weight;
      float sum = 0, d2 = 0;
      for (const auto& [distance2, weight] : found) {
        sum += weight, d2 = distance2;
        if (sum >= wanted) break;
      }
      const float missing = sum > 0 ? std::max(1.f, wanted / sum) : 1;
      radii[static_cast<size_t>(i)] = std::sqrt(d2) * std::pow(missing, 1 / static_cast<float>(dimensions));
    }
  });
  return radii;
}

namespace {

/// What a ball sends to the media within it, for each part of its falloff: 1 / d^2 of its middle, and the polynomial of
/// spreadFalloff() without its last term and that term alone.
struct LightWithin {
  float point = 0, edge = 0, core = 0;

  /// `met`: how much of the light of the middle is met between two distances, `u` from the middle, over the radius.
  void add(float met, float u) {
    const float t = 1 - u * u;
    point += met, edge += met * u * u * (1 + t), core += met * square(u * t);
  }
  float neededCore() const {
    constexpr float kHardlyAny = 1e-4f;  // rounding would decide
    return core > kHardlyAny ? std::fmax(0.f, (point - edge) / core) : NearField::kPlainCore;
  }
};

/// What a light's table says in a few directions all around, linear between its nodes, as the kernels' loop reads it.
class DepthsAround {
 public:
  DepthsAround(const DepthTable& table, const KernelLight& light) : table_(table) {
    for (int k = 0; k < kDirections; ++k) {
      const Vec2 place = {(2 * static_cast<float>(k % kEdge) + 1) / kEdge,
                          (2 * static_cast<float>(k / kEdge) + 1) / kEdge};
      const Vec3 w = fromOctahedron({place.x - 1, place.y - 1});
      // The solid angle of a part of the octahedron is as the third power of how much farther out the sphere is.
      const float angle = std::fabs(w.x) + std::fabs(w.y) + std::fabs(w.z);
      const float c = light.ax * w.x + light.ay * w.y + light.az * w.z;
      share_[k] = angle * angle * angle * kernels::endScattering<EndKind::henyeyGreenstein>(c, light.anisotropy);
      blend(place);
    }
  }

  LightWithin within(float radius) const {
    LightWithin all;
    int node[kSteps];
    float beyond[kSteps];
    for (int i = 0; i < kSteps; ++i) {
      const float d = radius * static_cast<float>(i + 1) / kSteps, reach = d / table_.view.last;
      const float m =
          std::fmin(std::sqrt(reach) * static_cast<float>(table_.radii - 1), static_cast<float>(table_.radii) - 1.001f);
      node[i] = static_cast<int>(m), beyond[i] = m - static_cast<float>(node[i]);
    }
    for (int k = 0; k < kDirections; ++k) {
      const float* const depth = &depth_[static_cast<size_t>(k * table_.radii)];
      float before = 1;
      for (int i = 0; i < kSteps; ++i) {
        const float through = kernels::falling(lerp(depth[node[i]], depth[node[i] + 1], beyond[i]));
        all.add(share_[k] * (before - through), (static_cast<float>(i) + 0.5f) / kSteps);
        before = through;
      }
    }
    return all;
  }

 private:
  static constexpr int kEdge = 5, kDirections = kEdge * kEdge, kSteps = 8;

  /// Adds the depths at all distances in a direction; `place` in [0, 2)^2 on the map.
  void blend(Vec2 place) {
    const float x = place.x * 0.5f * static_cast<float>(table_.side - 1),
                y = place.y * 0.5f * static_cast<float>(table_.side - 1);
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
    const float* const at = table_.depth + (row * table_.side + column) * table_.radii;
    const float* const below = at + table_.side * table_.radii;
    for (int m = 0; m < table_.radii; ++m)
      depth_.push_back(lerp(lerp(at[m], at[table_.radii + m], fx), lerp(below[m], below[table_.radii + m], fx), fy));
  }

  DepthTable table_;
  float share_[kDirections];
  std::vector<float> depth_;  ///< direction by direction
};

}  // namespace

LightBall ballWithin(std::span<const DepthTable> media, const KernelLight& light, float radius, float least,
                     float mostCore) {
  constexpr float kSmaller = 0.85f;
  VIRGA_ASSERT(!media.empty());
  std::vector<DepthsAround> channels;
  for (const DepthTable& table : media) channels.emplace_back(table, light);
  for (;; radius = std::max(least, radius * kSmaller)) {
    float core[3], most = 0;
    for (size_t c = 0; c < 3; ++c) {
      core[c] = c < channels.size() ? channels[c].within(radius).neededCore() : core[0];
      most = std::max(most, core[c]);
    }
    if (most > mostCore && radius > least) continue;
    return {radius, {std::min(core[0], mostCore), std::min(core[1], mostCore), std::min(core[2], mostCore)}};
  }
}

float coreFor(float depth) {
  constexpr int kSteps = 64;
  float point = 0, edge = 0, core = 0;  // integrals over the ball, by the distance u from its middle
  for (int i = 0; i < kSteps; ++i) {
    const float u = (static_cast<float>(i) + 0.5f) / kSteps, t = 1 - u * u, through = std::exp(-depth * u);
    point += through;
    edge += through * u * u * (1 + t);
    core += through * square(u * t);
  }
  return (point - edge) / core;
}

}  // namespace virga
