// SPDX-License-Identifier: Apache-2.0
#include "transport/lamp_tables.h"

#include "core/parallel.h"
#include "transport/media_bounds.h"
#include "transport/media_march.h"
#include "transport/virtual_lights.h"

namespace virga {
namespace {

/// A wider square of directions would waste its corners: all around is better.
constexpr float kMostReach = 1.5f;

/// Nodes of a table in either direction. Fewer take hardly less time.
constexpr int kFewNodes = 96, kManyNodes = LampTables::kMostByDefault;
/// So many, if they are to be close where the media end.
constexpr int kManyFarAway = 192;
/// Half as many radii as nodes in either direction, but not fewer than these where a table is not meant to be small.
constexpr int kFewRadii = 96;
constexpr float kNodesPerVoxel = 1.5f;
/// Of a grid that is a small part of all media.
constexpr int kFewAcross = 32;

bool isPointLike(const EmitterView& e) {
  return e.kind == EmitterView::Kind::point || e.kind == EmitterView::Kind::spot;
}

int lampsOf(const SceneView& scene) {
  return static_cast<int>(std::count_if(scene.emitters.begin(), scene.emitters.end(), isPointLike));
}
int channelsOf(const SceneView& scene) { return scene.chromatic ? 3 : 1; }

int radiiOf(int side) { return std::max(side < kFewNodes ? 2 : kFewRadii, side / 2); }

LampTable tableFor(const Bounds& media, Vec3 p, int side, int channels) {
  LampTable table;
  table.side = side, table.radii = radiiOf(side), table.channels = channels, table.p = p;
  const Vec3 way = media.center() - p;
  const float d = length(way), radius = 0.5f * length(media.extent());
  table.last = d + radius;
  if (!(d > 1.001f * radius)) return table;
  table.first = d - radius;
  const Frame frame(way / d);
  // As far as the corners of the bounds reach.
  float reach = 0;
  for (int i = 0; i < 8; ++i) {
    const Vec3 w = frame.toLocal(media.corner(i) - p);
    const float most = std::max(std::fabs(w.x), std::fabs(w.y));
    reach = w.z > 0 ? std::max(reach, most / w.z) : kInfinity;
  }
  if (reach > kMostReach) return table;
  table.frame = frame, table.reach = reach * 1.0001f;
  return table;
}

/// How far the outer directions of a table are apart where media end [unit], at most.
float widestTable(const SceneView& scene, const Bounds& media) {
  float widest = 0;
  for (const EmitterView& emitter : scene.emitters) {
    if (!isPointLike(emitter)) continue;
    const LampTable table = tableFor(media, emitter.position, kFewNodes, 1);
    widest = std::max(widest, table.last * (table.reach > 0 ? 2 * table.reach : kPi));
  }
  return widest;
}

/// Marches from the lamp along one node's direction.
void fillDirection(const Scene& scene, const LampTable& table, const MediaState& media, int row, int column,
                   float* depth) {
  const EmbreeRays rays{*scene.surfaceRays, *scene.boundaryRays};
  const auto place = [&](int n) { return 2 * static_cast<float>(n) / static_cast<float>(table.side - 1) - 1; };
  MediaRay r{{table.p, table.direction({place(column), place(row)})}, media, 0};
  const float spacing = (table.last - table.first) / static_cast<float>(table.radii - 1);
  Rgb sum;
  int m = 0;
  float radius = table.first;  // number m
  float* nodes = depth + table.offset(0, row, column);
  const size_t channelSize = table.offset(1, 0, 0);
  const auto set = [&](Rgb value) {
    for (int c = 0; c < table.channels; ++c)
      nodes[channelSize * static_cast<size_t>(c) + static_cast<size_t>(m)] = value[c];
    radius = table.first + spacing * static_cast<float>(++m);
  };
  walkMedia(scene.view, rays, r, table.last, [&](float t0, float t1) {
    return marchMedia(scene.view, r.media, r.ray, t0, t1, table.radii, 0, [&](float a, float b, Rgb own) {
      while (m < table.radii && radius < b) set(sum + own * (std::max(0.f, radius - a) / (b - a)));
      sum += own;
      return true;
    });
  });
  for (int c = 0; c < table.channels; ++c) {
    float* const own = nodes + channelSize * static_cast<size_t>(c);
    std::fill(own + m, own + table.radii, sum[c]);
  }
}

void clearRow(const LampTable& table, int row, float* depth) {
  for (int c = 0; c < table.channels; ++c)
    std::fill(depth + table.offset(c, row, 0), depth + table.offset(c, row + 1, 0), 0.f);
}

}  // namespace

LampTables::LampTables(const Scene& scene, int side, const std::stop_token& stop) {
  const SceneView& view = scene.view;
  if (!mayHaveLampTables(view)) return;
  const Bounds bounds = boundsOfMedia(scene);
  if (bounds.empty()) return;
  const int endless = endlessMedium(scene), channels = channelsOf(view);
  for (const EmitterView& emitter : view.emitters) {
    tables_.emplace_back();
    if (!isPointLike(emitter)) continue;
    LampTable& table = tables_.back() = tableFor(bounds, emitter.position, side, channels);
    float* const depths = depths_.emplace_back(new float[table.offset(channels, 0, 0)]).get();
    table.depth = depths;
    const MediaState media = mediaAt(scene, table.p, endless);
    parallelFor(side, 1, [&](int64_t row) {
      if (stop.stop_requested()) return clearRow(table, static_cast<int>(row), depths);
      for (int column = 0; column < side; ++column)
        fillDirection(scene, table, media, static_cast<int>(row), column, depths);
    });
  }
}

bool mayHaveLampTables(const SceneView& scene) {
  const int lamps = lampsOf(scene);
  return lamps > 0 && lamps <= LampTables::kMostLamps && scene.media.size > 0 &&
         std::all_of(scene.media.begin(), scene.media.end(), endsByItself);
}

float wantedLampTableSide(const Scene& scene) {
  if (!mayHaveLampTables(scene.view)) return 0;
  const Bounds bounds = boundsOfMedia(scene);
  const float across = maxComponent(bounds.extent()), widest = widestTable(scene.view, bounds);
  float wanted = 0;
  for (int m = 0; m < scene.view.media.size; ++m) {
    const GridView& grid = scene.view.media[m].density;
    Bounds own;
    for (const Bounds& place : placesOf(scene, m)) own.extend(place);
    if (own.empty()) continue;
    const float nodes = kNodesPerVoxel * maxComponent(grid.supportHi - grid.supportLo);
    const float extent = std::max(maxComponent(own.extent()), 1e-6f * across);
    const float alone = clamp(nodes, kFewAcross, kManyNodes) * std::max(1.f, across / extent);
    wanted = std::max({wanted, alone, std::min(widest / extent * nodes, float{kManyFarAway})});
  }
  return wanted > 0 ? std::max(wanted, float{kFewNodes}) : 0;
}

int lampTableSide(const Scene& scene) {
  constexpr size_t kMostBytes = 160 << 20;
  const float wanted = wantedLampTableSide(scene);
  int side = static_cast<int>(std::min(wanted, float{kManyNodes}));
  while (side > kFewNodes && lampTableBytes(scene.view, side) > kMostBytes) side /= 2;
  return 2 * static_cast<float>(side) >= wanted ? side : 0;
}

size_t lampTableBytes(const SceneView& scene, int side) {
  return static_cast<size_t>(lampsOf(scene) * channelsOf(scene)) * static_cast<size_t>(side * side) *
         static_cast<size_t>(radiiOf(side)) * sizeof(float);
}

}  // namespace virga
