// SPDX-License-Identifier: Apache-2.0
#include "transport/defence.h"

#include <algorithm>
#include <cmath>

#include "scene/scene_parts.h"
#include "transport/media_bounds.h"

namespace virga {
namespace {

/// Mean of the density where it is not 0: over the coarse cells.
float meanDensity(const MediumView& medium) {
  if (medium.homogeneous) return 1;
  const GridView& grid = medium.density;
  double sum = grid.background;
  int count = grid.background > 0 ? 1 : 0;
  const int cells = grid.kind == GridView::Kind::constant ? 0 : grid.mean.nx * grid.mean.ny * grid.mean.nz;
  for (int i = 0; i < cells; ++i)
    if (grid.mean.values[i] > 0) sum += grid.mean.values[i], ++count;
  return count > 0 ? static_cast<float>(sum / count) : 0;
}

/// Of the shapes that each medium fills; empty where that is not known.
std::vector<Bounds> boundsOfEach(const Scene& scene) {
  std::vector<Bounds> bounds(static_cast<size_t>(scene.view.media.size));
  const auto extend = [&](const MediumTransition& media, const Bounds& shape) {
    if (media.interior != MediumTransition::kNone) bounds[static_cast<size_t>(media.interior)].extend(shape);
    if (media.exterior != MediumTransition::kNone)
      bounds[static_cast<size_t>(media.exterior)].extend(scene.view.bounds);
  };
  for (size_t i = 0; i < scene.parts->boundaries.size(); ++i)
    extend(scene.parts->boundaries[i], scene.parts->boundaryShapes[i]->bounds);
  for (size_t i = 0; i < scene.parts->surfaces.size(); ++i)
    extend(scene.parts->surfaces[i].media, scene.parts->surfaceShapes[i]->bounds);
  return bounds;
}

/// Extents of the shapes that each medium fills [unit]; the scene's where that is not known.
std::vector<float> extents(const Scene& scene) {
  std::vector<float> result;
  for (const Bounds& b : boundsOfEach(scene)) {
    const float across = b.empty() ? 0 : length(b.extent()), whole = length(scene.view.bounds.extent());
    result.push_back(across > 0 ? across : whole > 0 ? whole : scene.view.scale);
  }
  return result;
}

/// Means over each cell and those around it: where smoke may be a few frames later.
std::vector<float> spreadOut(const CoarseGridView& cells) {
  std::vector<float> result;
  const auto range = [](int i, int n) { return std::pair(std::max(0, i - 1), std::min(n - 1, i + 1)); };
  for (int k = 0; k < cells.nz; ++k)
    for (int j = 0; j < cells.ny; ++j)
      for (int i = 0; i < cells.nx; ++i) {
        const auto [x0, x1] = range(i, cells.nx);
        const auto [y0, y1] = range(j, cells.ny);
        const auto [z0, z1] = range(k, cells.nz);
        float sum = 0;
        for (int z = z0; z <= z1; ++z)
          for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) sum += cells.cell(x, y, z);
        result.push_back(sum / 27);
      }
  return result;
}

/// Of the mean extinction, the floor under means that are spread.
constexpr float kFloor = 0.7f;

/// Of the mean extinction since the walks were drawn.
constexpr float kMostGrowth = 2;

/// How much extinction there was, and how much has come or gone.
struct ExtinctionChange {
  double all = 0, changed = 0;

  void add(Rgb then, Rgb now, double volume) {
    for (int c = 0; c < 3; ++c) {
      all += static_cast<double>(then[c]) * volume;
      changed += static_cast<double>(std::fabs(now[c] - then[c])) * volume;
    }
  }
  float share() const {
    if (!(changed > 0)) return 0;
    return all > 0 ? static_cast<float>(std::min(1., changed / all)) : 1;
  }
};

bool isWithin(const std::vector<Bounds>& places, Vec3 p) {
  return std::any_of(places.begin(), places.end(), [&](const Bounds& b) {
    return p.x >= b.lo.x && p.y >= b.lo.y && p.z >= b.lo.z && p.x <= b.hi.x && p.y <= b.hi.y && p.z <= b.hi.z;
  });
}

/// Does a point lie in a coarse cell that is not empty?
bool isFilled(const MediumView& medium, Vec3 p) {
  if (!isGrid(medium)) return false;
  const Vec3 q = medium.worldToDensity.point(p);
  return medium.density.supports(q) && medium.density.majorant.cellAt(q) > 0;
}

/// Number n of an additive sequence in [0, 1)^3 (Roberts 2018: powers of the root of x^4 = x + 1).
Vec3 spreadPoint(uint32_t n) {
  const auto part = [n](double step) { return static_cast<float>(std::fmod(0.5 + step * n, 1)); };
  return {part(0.8191725133961645), part(0.6710436067037893), part(0.5497004779019703)};
}

/// At points in the filled cells of `in`, which is one of the two: small smoke in a large grid has as many as any
/// other.
template <class LeaveOut>
void compareCells(const MediumView& in, const std::vector<Bounds>& places, const LeaveOut& leaveOut,
                  const MediumView& then, const MediumView& now, ExtinctionChange& change) {
  constexpr int kPoints = 8192;  // at least, in all
  if (!isGrid(in)) return;
  const CoarseGridView& cells = in.density.majorant;
  int filled = 0;
  visitFilledCells(cells, [&](Vec3, float) { ++filled; });
  const int each = (kPoints + filled - 1) / std::max(1, filled);
  const Affine toWorld = in.worldToDensity.inverse();
  const Vec3 size = cells.cellSize;
  const float cell = std::fabs(dot(toWorld.x * size.x, cross(toWorld.y * size.y, toWorld.z * size.z)));
  const double volume = static_cast<double>(cell) / each;
  uint32_t n = 0;
  visitFilledCells(cells, [&](Vec3 lo, float) {
    for (int i = 0; i < each; ++i) {
      const Vec3 p = toWorld.point(lo + spreadPoint(n++) * size);
      if (isWithin(places, p) && !leaveOut(p)) change.add(then.sigmaTAt(p), now.sigmaTAt(p), volume);
    }
  });
}

ExtinctionChange compareInBox(const Bounds& box, const MediumView& then, const MediumView& now) {
  constexpr uint32_t kPoints = 4096;
  ExtinctionChange change;
  for (uint32_t n = 0; n < kPoints && !box.empty(); ++n) {
    const Vec3 p = box.lo + box.extent() * spreadPoint(n);
    change.add(then.sigmaTAt(p), now.sigmaTAt(p), 1);
  }
  return change;
}

}  // namespace

std::vector<Rgb> meanExtinctions(const Scene& scene) {
  std::vector<Rgb> result;
  for (const MediumView& m : scene.view.media) result.push_back(m.spectrum * (m.sigmaT * meanDensity(m)));
  return result;
}

Defence defenceOf(const Scene& scene, const std::vector<Rgb>& extinctions) {
  Defence defence;
  const std::vector<float> across = extents(scene);
  for (size_t m = 0; m < across.size(); ++m) {
    const MediumView& medium = scene.view.media[static_cast<int>(m)];
    const bool grid = isGrid(medium);
    DefensiveRates r{1 / across[m], mean(extinctions[m]) * (grid ? kFloor : 1), 0, {}};
    defence.spread.push_back(grid ? spreadOut(medium.density.mean) : std::vector<float>());
    if (grid) {
      r.spreadRate = medium.sigmaT * mean(medium.spectrum);
      r.spread = medium.density.mean;
      r.spread.values = defence.spread.back().data();
    }
    defence.rates.push_back(r);
  }
  return defence;
}

bool outgrown(const std::vector<Rgb>& now, const std::vector<Rgb>& then) {
  for (size_t m = 0; m < now.size(); ++m)
    for (int c = 0; c < 3; ++c)
      if (now[m][c] > kMostGrowth * then[m][c]) return true;
  return false;
}

float changeOfMedia(const Scene& before, const Scene& next) {
  float change = 0;
  for (int m = 0; m < next.view.media.size; ++m) {
    const MediumView &then = before.view.media[m], &now = next.view.media[m];
    const std::vector<Bounds> was = placesOf(before, m), is = placesOf(next, m);
    ExtinctionChange inCells;
    compareCells(
        then, was, [](Vec3) { return false; }, then, now, inCells);
    compareCells(
        now, is, [&](Vec3 p) { return isFilled(then, p) && isWithin(was, p); }, then, now, inCells);
    change = std::max(change, inCells.share());
    if (endsByItself(then) && endsByItself(now)) continue;
    Bounds all;
    for (const std::vector<Bounds>* places : {&was, &is})
      for (const Bounds& b : *places) all.extend(b);
    change = std::max(change, compareInBox(all, then, now).share());
  }
  return change;
}

}  // namespace virga
