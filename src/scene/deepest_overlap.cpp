// SPDX-License-Identifier: Apache-2.0
#include "scene/deepest_overlap.h"

#include <algorithm>

namespace virga {
namespace {

/// Divides space until what is left in a cell is simple (after Chan, "Klee's measure problem made easy", 2013): boxes
/// that fill the cell count everywhere in it; of those that fill it along two axes, the third decides, and the depths
/// of the three axes add up.
class OverlapSearch {
 public:
  explicit OverlapSearch(int enough) : enough_(enough) {}

  int deepest() const { return deepest_; }

  void search(const Bounds& cell, const std::vector<Bounds>& boxes, int filling) {
    std::vector<Bounds> partial;
    std::vector<Bounds> slabs[3];
    for (const Bounds& b : boxes) sortIn(cell, b, filling, slabs, partial);
    const int sure = filling + slabDepth(slabs[0], 0) + slabDepth(slabs[1], 1) + slabDepth(slabs[2], 2);
    deepest_ = std::max(deepest_, std::min(sure, enough_));
    if (deepest_ == enough_ || sure + static_cast<int>(partial.size()) <= deepest_) return;
    for (const auto& s : slabs) partial.insert(partial.end(), s.begin(), s.end());
    split(cell, partial, filling);
  }

 private:
  static bool fills(const Bounds& b, const Bounds& cell, int axis) {
    return b.lo[axis] <= cell.lo[axis] && b.hi[axis] >= cell.hi[axis];
  }

  static void sortIn(const Bounds& cell, const Bounds& b, int& filling, std::vector<Bounds> (&slabs)[3],
                     std::vector<Bounds>& partial) {
    int open = 0, axis = 0;
    for (int i = 0; i < 3; ++i) {
      if (b.lo[i] >= cell.hi[i] || b.hi[i] <= cell.lo[i] || b.lo[i] >= b.hi[i]) return;
      if (!fills(b, cell, i)) ++open, axis = i;
    }
    if (open == 0) ++filling;
    if (open == 1) slabs[axis].push_back(b);
    if (open > 1) partial.push_back(b);
  }

  // The most intervals over one point of an axis.
  static int slabDepth(const std::vector<Bounds>& slabs, int axis) {
    std::vector<std::pair<float, int>> ends;
    for (const Bounds& s : slabs) ends.insert(ends.end(), {{s.lo[axis], 1}, {s.hi[axis], -1}});
    std::sort(ends.begin(), ends.end());  // at one place, ends come before starts
    int depth = 0, most = 0;
    for (const auto& [at, step] : ends) most = std::max(most, depth += step);
    return most;
  }

  // Along the axis with the most faces of boxes that are no slabs, at their median.
  void split(const Bounds& cell, const std::vector<Bounds>& boxes, int filling) {
    std::vector<float> faces[3];
    for (const Bounds& b : boxes) {
      const int open = !fills(b, cell, 0) + !fills(b, cell, 1) + !fills(b, cell, 2);
      for (int axis = 0; axis < 3 && open > 1; ++axis)
        for (const float f : {b.lo[axis], b.hi[axis]})
          if (f > cell.lo[axis] && f < cell.hi[axis]) faces[axis].push_back(f);
    }
    int axis = 0;
    for (int i = 1; i < 3; ++i)
      if (faces[i].size() > faces[axis].size()) axis = i;
    const auto median = faces[axis].begin() + static_cast<std::ptrdiff_t>(faces[axis].size() / 2);
    std::nth_element(faces[axis].begin(), median, faces[axis].end());
    Bounds lower = cell, upper = cell;
    lower.hi[axis] = upper.lo[axis] = *median;
    search(lower, boxes, filling);
    search(upper, boxes, filling);
  }

  const int enough_;
  int deepest_ = 0;
};

}  // namespace

int deepestOverlap(std::vector<Bounds> boxes, int enough) {
  Bounds all;
  for (const Bounds& b : boxes) all.extend(b);
  OverlapSearch search(enough);
  if (!boxes.empty()) search.search(all, boxes, 0);
  return search.deepest();
}

}  // namespace virga
