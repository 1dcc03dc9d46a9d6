// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/path/path_pixels.h"

namespace virga {

/// What one ray query was asked.
struct QueriedRay {
  Ray ray;
  float tMax;
};
/// A part of a ray in one heterogeneous medium.
struct GridFlight {
  Ray ray;
  float t0, t1;
  int medium;
};
/// A ray to a lamp on which its table was held against the exact optical depth.
struct TableCheck {
  MediaRay from;
  float tMax;
};
struct MediumPoint {
  Vec3 p;  ///< index coordinates of the medium's density
  int medium;
};

/// What paths through a scene's pixels ask of ray queries, grids and lamps' tables, in their order.
struct PathRecord {
  int64_t paths = 0;
  std::vector<QueriedRay> nearest, occluded, crossings;
  std::vector<RayPacket> packets;       ///< of occluded()
  std::vector<GridFlight> freeFlights;  ///< through the grids on a path's segments
  std::vector<GridFlight> shadows;      ///< and on connections
  std::vector<MediumPoint> lookups;     ///< of both
  std::vector<Vec3> tableLookups;       ///< places in the world
  std::vector<TableCheck> checks;
  const LampTable* table = nullptr;  ///< of the scene's one lamp that has one
};

/// One path through each pixel, in groups where those share paths. Ray queries are the very
/// ones of the paths; lookups are drawn anew along their segments, by the same rules.
PathRecord recordPaths(const Scene& scene, const PathOptions& options);

/// Traces such paths without a record, one thread; how many they are.
int64_t tracePaths(const Scene& scene, const PathOptions& options, uint32_t replicate);

}  // namespace virga
