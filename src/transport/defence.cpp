// SPDX-License-Identifier: Apache-2.0
#include "transport/defence.h"

#include <algorithm>
#include <cmath>

#include "scene/scene_parts.h"

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
    const bool grid = !medium.homogeneous && medium.density.kind != GridView::Kind::constant;
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
  constexpr int kPoints = 16;  // in each direction
  const std::vector<Bounds> bounds = boundsOfEach(next);
  float change = 0;
  for (size_t m = 0; m < bounds.size(); ++m) {
    const MediumView &then = before.view.media[static_cast<int>(m)], &now = next.view.media[static_cast<int>(m)];
    const Bounds& where = bounds[m].empty() ? next.view.bounds : bounds[m];
    const auto place = [](int n) { return (static_cast<float>(n % kPoints) + 0.5f) / kPoints; };
    double all = 0, changed = 0;
    for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
      const Vec3 p = where.lo + where.extent() * Vec3(place(i), place(i / kPoints), place(i / kPoints / kPoints));
      const Rgb a = then.sigmaTAt(p), b = now.sigmaTAt(p);
      for (int c = 0; c < 3; ++c)
        all += static_cast<double>(a[c]), changed += static_cast<double>(std::fabs(a[c] - b[c]));
    }
    if (changed > 0) change = std::max(change, all > 0 ? static_cast<float>(std::min(1., changed / all)) : 1);
  }
  return change;
}

}  // namespace virga
