// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <stop_token>
#include <vector>

#include "core/octahedral.h"
#include "scene/scene.h"

namespace virga {

/// Optical depths of the media between a point-like lamp and places around it, at nodes of a square of directions and
/// of distances, linear between them: a deep shadow map (Lokovic and Veach 2000) of media alone. Plain data.
struct LampTable {
  const float* depth = nullptr;  ///< [channel][row][column][radius]; null: there is no table
  int side = 0, radii = 0;       ///< nodes along the square's edge, the outer ones on it, and along each direction
  int channels = 1;              ///< that differ: 1 or 3
  Vec3 p;                        ///< of the lamp
  Frame frame{Vec3(0, 0, 1)};    ///< its n looks at the middle of the square
  float reach = 0;               ///< tangent of half the square's angle; 0: an octahedral map of all directions
  float first = 0, last = 0;     ///< distances of the first and the last radius [unit]: all media lie between them

  VIRGA_HD bool present() const { return depth != nullptr; }

  /// Of the node at a place in [-1, 1]^2, in the world.
  VIRGA_HD Vec3 direction(Vec2 q) const {
    return frame.toWorld(reach > 0 ? normalize(Vec3(q.x * reach, q.y * reach, 1)) : fromOctahedron(q));
  }

  /// Optical depth between the lamp and x.
  VIRGA_HD Rgb depthTo(Vec3 x) const {
    const Vec3 way = frame.toLocal(x - p);
    const float d = length(way);
    if (!(d > first)) return {};
    Vec2 q;
    if (reach > 0) {
      const float most = reach * way.z;
      if (!(std::fabs(way.x) < most && std::fabs(way.y) < most)) return {};
      q = {way.x / most, way.y / most};
    } else {
      q = toOctahedron(way);
    }
    const float m = (d - first) / (last - first);
    const Nodes column(0.5f * (q.x + 1), side), row(0.5f * (q.y + 1), side), radial(std::fmin(m, 1.f), radii);
    const auto along = [&](const float* at) { return lerp(at[0], at[1], radial.share); };
    Rgb found;
    for (int c = 0; c < channels; ++c) {
      const float* at = depth + offset(c, row.index, column.index) + radial.index;
      const float* below = at + static_cast<size_t>(side) * static_cast<size_t>(radii);
      found[c] = lerp(lerp(along(at), along(at + radii), column.share),
                      lerp(along(below), along(below + radii), column.share), row.share);
    }
    return channels == 1 ? Rgb(found.r) : found;
  }

  VIRGA_HD size_t offset(int channel, int row, int column) const {
    const auto n = static_cast<size_t>(side);
    return ((static_cast<size_t>(channel) * n + static_cast<size_t>(row)) * n + static_cast<size_t>(column)) *
           static_cast<size_t>(radii);
  }

 private:
  /// The two of `count` nodes around a place in [0, 1], and where it lies between them.
  struct Nodes {
    int index;
    float share;
    VIRGA_HD Nodes(float place, int count) {
      const float x = place * static_cast<float>(count - 1);
      index = std::min(static_cast<int>(x), count - 2);
      share = x - static_cast<float>(index);
    }
  };
};

/// Tables of a scene's point and spot lamps, where they can be made: where all media are grids, with nothing around
/// their values.
class LampTables {
 public:
  static constexpr int kMostLamps = 8;  ///< where there are more, marching costs less than filling their tables
  static constexpr int kLeastSide = 2, kMostSide = 512, kMostByDefault = 256;
  static constexpr size_t kMostBytes = size_t{1} << 30;

  LampTables() = default;
  /// `side`: nodes of each table in either direction. Half as many radii, but where `side` is 96 or more at least 96.
  /// A stop leaves zeros.
  LampTables(const Scene& scene, int side, const std::stop_token& stop);

  /// One for each emitter, or none at all. Points into this object.
  View<LampTable> view() const { return viewOf(tables_); }

 private:
  std::vector<LampTable> tables_;
  std::vector<std::unique_ptr<float[]>> depths_;  ///< not cleared: the threads that fill them touch them first
};

/// Are all media grids that end by themselves, and is there a point or spot lamp, but not too many?
bool mayHaveLampTables(const SceneView& scene);
/// Nodes in either direction that do justice to each of the scene's grids: one and a half for each of its voxels, but
/// at least 32 and at most 256 of them across it, and the more of them the less of all media it is. However many these
/// are, but 96 at least and, up to 192, so many that they are as close where the media end, as seen from the lamps.
/// 0 where there can be no tables.
float wantedLampTableSide(const Scene& scene);
/// The same, if half as many are within 256 and 160 MB; otherwise 0: where small grids lie far apart marching is
/// better.
int lampTableSide(const Scene& scene);
/// What tables of that side take [bytes].
size_t lampTableBytes(const SceneView& scene, int side);

}  // namespace virga
