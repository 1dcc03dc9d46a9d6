// SPDX-License-Identifier: Apache-2.0
#include "scene/closed_mesh.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace virga {
namespace {

/// A triangle's side, from its lower vertex to its higher one or back.
struct Side {
  uint32_t low, high, triangle;
  bool upward;

  auto edge() const { return std::tie(low, high); }
};

// For each vertex the number of the place where it is.
std::vector<uint32_t> places(const TriangleMesh& mesh) {
  const std::vector<Vec3>& p = mesh.positions;
  const auto before = [&](uint32_t i, uint32_t j) {
    return std::tie(p[i].x, p[i].y, p[i].z) < std::tie(p[j].x, p[j].y, p[j].z);
  };
  std::vector<uint32_t> order(p.size()), place(p.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), before);
  uint32_t current = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && before(order[i - 1], order[i])) ++current;
    place[order[i]] = current;
  }
  return place;
}

// All sides, those of one edge together. Triangles that have shrunk to a line have none.
std::vector<Side> sortedSides(const TriangleMesh& mesh) {
  const std::vector<uint32_t> place = places(mesh);
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const uint32_t v[] = {place[mesh.triangles[t][0]], place[mesh.triangles[t][1]], place[mesh.triangles[t][2]]};
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    for (int i = 0; i < 3; ++i) {
      const uint32_t from = v[i], to = v[(i + 1) % 3];
      sides.push_back({std::min(from, to), std::max(from, to), t, from < to});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.edge() < b.edge(); });
  return sides;
}

// visit(first, last) for the sides of each edge.
template <class Visit>
void forEachEdge(const std::vector<Side>& sides, Visit&& visit) {
  for (auto first = sides.begin(); first != sides.end();) {
    const auto last = std::find_if(first, sides.end(), [&](const Side& s) { return s.edge() != first->edge(); });
    visit(first, last);
    first = last;
  }
}

/// Connected triangles, and which of them are wound against the first one of their part: union-find, in which each
/// triangle knows its parent and whether it is turned against it.
class WindingParts {
 public:
  explicit WindingParts(size_t triangles) : parent_(triangles), turned_(triangles, 0) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }

  struct Root {
    uint32_t triangle;
    bool turned;
  };
  Root root(uint32_t t) {
    bool turned = false;
    while (parent_[t] != t) {
      // The path is halved on the way. Roots are never turned against themselves.
      turned_[t] ^= turned_[parent_[t]];
      parent_[t] = parent_[parent_[t]];
      turned ^= turned_[t] != 0;
      t = parent_[t];
    }
    return {t, turned};
  }
  void link(uint32_t a, uint32_t b, bool turned) {
    const Root x = root(a), y = root(b);
    if (x.triangle == y.triangle) return;
    parent_[x.triangle] = y.triangle;
    turned_[x.triangle] = (x.turned ^ y.turned ^ turned) ? 1 : 0;
  }

 private:
  std::vector<uint32_t> parent_;
  std::vector<uint8_t> turned_;
};

}  // namespace

size_t openEdges(const TriangleMesh& mesh) {
  size_t open = 0;
  const std::vector<Side> sides = sortedSides(mesh);
  forEachEdge(sides, [&](auto first, auto last) {
    const auto upward = std::count_if(first, last, [](const Side& s) { return s.upward; });
    if (2 * upward != last - first) ++open;
  });
  return open;
}

void makeWindingAgree(TriangleMesh& mesh) {
  WindingParts parts(mesh.triangles.size());
  const std::vector<Side> sides = sortedSides(mesh);
  forEachEdge(sides, [&](auto first, auto last) {
    if (last - first == 2) parts.link(first[0].triangle, first[1].triangle, first[0].upward == first[1].upward);
  });
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  std::vector<int64_t> against(count);  // how many more are turned against a root than are not
  for (uint32_t t = 0; t < count; ++t) {
    const auto root = parts.root(t);
    against[root.triangle] += root.turned ? 1 : -1;
  }
  for (uint32_t t = 0; t < count; ++t) {
    const auto root = parts.root(t);
    if (root.turned != (against[root.triangle] > 0)) std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  }
}

}  // namespace virga
