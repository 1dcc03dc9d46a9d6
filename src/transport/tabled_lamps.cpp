// SPDX-License-Identifier: Apache-2.0
#include "transport/tabled_lamps.h"

#include <algorithm>

#include "transport/media_bounds.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

/// Points at which a table is held against the truth before it is used, and how many are tried to find them.
constexpr size_t kPoints = 512;
constexpr int kMostTrials = 1 << 16;
/// Checks are as frequent as errors are large, beside the light itself: that is the best for a given cost. The factor
/// was found by rendering.
constexpr float kChecksPerError = 0.75f, kFewestChecks = 0.01f;
/// A check takes as many steps as there are voxels on the way. Beyond so many steps for each look-up shadow rays are
/// the better choice.
constexpr float kMostSteps = 24, kMostChecks = 0.3f;

/// A coarse cell of a medium's grid that is not empty.
struct FilledCell {
  int medium;
  Vec3 lo;  ///< index coordinates
  float majorant;
};

std::vector<FilledCell> filledCells(const SceneView& scene) {
  std::vector<FilledCell> filled;
  for (int m = 0; m < scene.media.size; ++m)
    visitFilledCells(scene.media[m].density.majorant, [&](Vec3 lo, float majorant) {
      filled.push_back({m, lo, majorant});
    });
  return filled;
}

/// Points in the media, in each filled cell alike often and in proportion to the density.
std::vector<Vec3> pointsInMedia(const SceneView& scene) {
  const std::vector<FilledCell> cells = filledCells(scene);
  std::vector<Vec3> points;
  if (cells.empty()) return points;
  std::vector<Affine> toWorld;
  for (const MediumView& medium : scene.media) toWorld.push_back(medium.worldToDensity.inverse());
  Pcg32 random(1);
  const auto one = [&] { return random.next(); };
  for (int n = 0; n < kMostTrials && points.size() < kPoints; ++n) {
    const auto index = static_cast<size_t>(one() * static_cast<float>(cells.size()));
    const FilledCell& cell = cells[std::min(index, cells.size() - 1)];
    const MediumView& medium = scene.media[cell.medium];
    const Vec3 q = cell.lo + medium.density.majorant.cellSize * Vec3(one(), one(), one());
    if (one() * cell.majorant < medium.density.lookup(q))
      points.push_back(toWorld[static_cast<size_t>(cell.medium)].point(q));
  }
  return points;
}

/// What a table's transmittances are off by, relative to these (root mean squares of both): the noise of checks
/// competes with that of the light that arrives. Infinite where nothing tells.
float errorOf(const Scene& scene, const LampTable& table, const std::vector<Vec3>& points, const MediaState& media) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  float off = 0, light = 0;
  for (const Vec3 x : points) {
    const float d = distance(table.p, x);
    if (!(d > 0)) continue;
    const float exact = std::exp(-opticalDepth(scene.view, rays, {{table.p, (x - table.p) / d}, media, 0}, d).r);
    off += square(exact - std::exp(-table.depthTo(x).r));
    light += square(exact);
  }
  return light > 0 ? std::sqrt(off / light) : kInfinity;
}

/// Is no surface in the way of a lamp's light to any point within the media's bounds?
bool isClear(const RayScene& surfaces, Vec3 lamp, Bounds media) {
  media.extend(lamp);
  return std::none_of(surfaces.shapes().begin(), surfaces.shapes().end(),
                      [&](const auto& shape) { return shape->mayMeet(media); });
}

float mostVoxels(const SceneView& scene) {
  float most = 0;
  for (const MediumView& medium : scene.media)
    most = std::max(most, maxComponent(medium.density.supportHi - medium.density.supportLo));
  return most;
}

}  // namespace

TabledLamps::TabledLamps(const Scene& scene, int side, const std::stop_token& stop) {
  const SceneView& view = scene.view;
  if (view.chromatic || side == 0) return;
  tables_ = LampTables(scene, side, stop);
  if (tables_.view().size == 0 || stop.stop_requested()) return;
  const Bounds media = boundsOfMedia(scene);
  const std::vector<Vec3> points = pointsInMedia(view);
  const int endless = endlessMedium(scene);
  const float voxels = mostVoxels(view);
  lamps_.resize(static_cast<size_t>(view.emitters.size));
  for (int i = 0; i < view.emitters.size; ++i) {
    const LampTable& table = tables_.view()[i];
    if (!table.present()) continue;
    const float error = errorOf(scene, table, points, mediaAt(scene, table.p, endless));
    const float checks = std::max(kFewestChecks, kChecksPerError * error);
    if (checks > kMostChecks || checks * voxels > kMostSteps) continue;
    lamps_[static_cast<size_t>(i)] = {table, checks, isClear(*scene.surfaceRays, table.p, media)};
  }
  if (std::none_of(lamps_.begin(), lamps_.end(), [](const TabledLamp& lamp) { return lamp.present(); })) lamps_.clear();
}

int tabledLampSide(const Scene& scene, int64_t pixels) {
  if (scene.view.chromatic || scene.view.thinGlass) return 0;
  size_t voxels = 0;
  for (const MediumView& medium : scene.view.media) {
    const Vec3 size = medium.density.supportHi - medium.density.supportLo;
    voxels += static_cast<size_t>(double{size.x} * double{size.y} * double{size.z});
  }
  // So many nodes take as long as a path or two.
  constexpr size_t kLeastBytes = 16 << 20, kNodesPerPixel = 64;
  const size_t most = std::min(std::max(kLeastBytes, voxels * sizeof(float) * 2 / 5),
                               static_cast<size_t>(pixels) * kNodesPerPixel * sizeof(float));
  int side = static_cast<int>(std::min(wantedLampTableSide(scene), float{LampTables::kMostByDefault}));
  while (side > LampTables::kLeastSide && lampTableBytes(scene.view, side) > most) side -= side / 8 + 1;
  return std::max(0, side);
}

}  // namespace virga
