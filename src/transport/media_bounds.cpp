// SPDX-License-Identifier: Apache-2.0
#include "transport/media_bounds.h"

#include <algorithm>
#include <numeric>

#include "scene/scene_parts.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

constexpr Bounds kEverywhere{Vec3(-kInfinity), Vec3(kInfinity)};

Bounds common(const Bounds& a, const Bounds& b) { return {max(a.lo, b.lo), min(a.hi, b.hi)}; }
bool contains(const Bounds& outer, const Bounds& inner) { return common(outer, inner) == inner; }

/// The cells of a grid that are not empty, as far as its values reach, in index coordinates.
Bounds filledInGrid(const GridView& grid) {
  Bounds filled;
  visitFilledCells(grid.majorant,
                   [&](Vec3 lo, float) { filled.extend(lo), filled.extend(lo + grid.majorant.cellSize); });
  return common(filled, {grid.supportLo, grid.supportHi});
}

/// Where a medium could be, wherever it is declared.
Bounds ownBounds(const MediumView& medium) {
  if (!endsByItself(medium)) return kEverywhere;
  const Bounds filled = filledInGrid(medium.density);
  return filled.empty() ? Bounds() : boundsInWorld(medium, filled);
}

/// Calls visit(media, bounds of the shape) for all shapes.
template <class Visit>
void visitShapes(const Scene& scene, const Visit& visit) {
  const Scene::Parts& parts = *scene.parts;
  for (size_t i = 0; i < parts.boundaries.size(); ++i) visit(parts.boundaries[i], parts.boundaryShapes[i]->bounds);
  for (size_t i = 0; i < parts.surfaces.size(); ++i) visit(parts.surfaces[i].media, parts.surfaceShapes[i]->bounds);
}

/// As far as media without end may matter: beyond all shapes, lamps and values of grids by twice what these span.
Bounds farBounds(const Scene& scene) {
  const SceneView& view = scene.view;
  Bounds near = view.bounds;  // without shapes: the camera's place
  if (view.surfaces.size == 0 && view.boundaries.size == 0)
    for (const EmitterView& e : view.emitters)
      if (e.isLocal()) near.extend(e.position);
  for (const MediumView& m : view.media)
    if (isGrid(m)) near.extend(boundsInWorld(m, {m.density.supportLo, m.density.supportHi}));
  const float across = length(near.extent()), beyond = across > 0 ? 2 * across : 1e3f;
  return {near.lo - Vec3(beyond), near.hi + Vec3(beyond)};
}

/// Where shapes and the sensor say that a medium is.
std::vector<Bounds> declaredPlaces(const Scene& scene, int medium) {
  std::vector<Bounds> places;
  bool everywhere = endlessMedium(scene) == medium;
  visitShapes(scene, [&](const MediumTransition& media, const Bounds& shape) {
    if (media.interior != medium) return;
    if (media.closed) places.push_back(shape);
    everywhere |= !media.closed;
  });
  // The exterior of a shape ends with one around it that the same medium fills, if there is one.
  const size_t filled = places.size();
  visitShapes(scene, [&](const MediumTransition& media, const Bounds& shape) {
    const auto isAround = [&](const Bounds& place) { return contains(place, shape); };
    if (media.exterior == medium)
      everywhere |= std::none_of(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(filled), isAround);
  });
  return everywhere ? std::vector<Bounds>{kEverywhere} : places;
}

Bounds unionOf(Bounds a, const Bounds& b) {
  a.extend(b);
  return a;
}

/// How little two boxes belong together: 0 where they have a point in common, or else what they span together, over
/// what the smaller one does.
float apart(const Bounds& a, const Bounds& b) {
  if (overlap(a, b)) return 0;
  const float least = std::min(length(a.extent()), length(b.extent()));
  return length(unionOf(a, b).extent()) / std::max(least, 1e-12f);
}

}  // namespace

bool isGrid(const MediumView& medium) { return !medium.homogeneous && medium.density.kind != GridView::Kind::constant; }

bool endsByItself(const MediumView& medium) { return isGrid(medium) && !(medium.density.background > 0); }

Bounds boundsInWorld(const MediumView& medium, const Bounds& inGrid) {
  const Affine toWorld = medium.worldToDensity.inverse();
  Bounds bounds;
  for (int i = 0; i < 8; ++i) bounds.extend(toWorld.point(inGrid.corner(i)));
  return bounds;
}

std::vector<Bounds> placesOf(const Scene& scene, int medium) {
  const MediumView& view = scene.view.media[medium];
  const Bounds own = ownBounds(view);
  std::vector<Bounds> places;
  for (const Bounds& declared : declaredPlaces(scene, medium)) {
    const Bounds place = common(own, declared);
    if (!place.empty()) places.push_back(place == kEverywhere ? farBounds(scene) : place);
  }
  return places;
}

Bounds boundsOfMedia(const Scene& scene) {
  Bounds bounds;
  for (int m = 0; m < scene.view.media.size; ++m)
    for (const Bounds& place : placesOf(scene, m)) bounds.extend(place);
  return bounds;
}

std::vector<Bounds> boxesOfMedia(const Scene& scene, size_t most, int without) {
  constexpr float kApart = 2;
  constexpr size_t kTooMany = 64;
  std::vector<Bounds> boxes;
  for (int m = 0; m < scene.view.media.size; ++m)
    if (m != without)
      for (const Bounds& place : placesOf(scene, m)) boxes.push_back(place);
  if (boxes.size() > kTooMany) boxes.assign(1, std::accumulate(boxes.begin(), boxes.end(), Bounds(), unionOf));
  for (;;) {
    float least = kInfinity;
    size_t first = 0, second = 0;
    for (size_t i = 0; i < boxes.size(); ++i)
      for (size_t j = i + 1; j < boxes.size(); ++j)
        if (const float a = apart(boxes[i], boxes[j]); a < least) least = a, first = i, second = j;
    if (boxes.size() < 2 || (least > kApart && boxes.size() <= most)) return boxes;
    boxes[first].extend(boxes[second]);
    boxes.erase(boxes.begin() + static_cast<std::ptrdiff_t>(second));
  }
}

}  // namespace virga
