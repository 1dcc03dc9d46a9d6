// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/lamp_tables.h"
#include "transport/optical_depth.h"
#include "transport/visibility.h"

namespace virga {

/// A point-like lamp whose light can be looked up, and how far its table is to be trusted. Plain data.
struct TabledLamp {
  LampTable table;
  float checks = 1;    ///< how often a look-up of weight 1 is held against the exact optical depth
  bool clear = false;  ///< no surface is between the lamp and anything in a medium

  VIRGA_HD bool present() const { return table.present(); }
  /// Of a look-up whose light counts `weight` times. What counts little is checked less often, but not much less: a
  /// check that finds the table wrong then counts the more.
  VIRGA_HD float checkProbability(float weight) const { return std::min(1.f, checks * clamp(weight, 0.1f, 1.f)); }
};

/// Unbiased estimate of what grey media let through from a lamp to x: what its table says and, in a few cases at random
/// and by so much the more, what that is off by. `ray` leads from x, or a little beside it, to the lamp.
/// The table is a control variate whose residual is estimated seldom. May be negative or greater than 1.
template <class Rays>
VIRGA_HD float estimateTransmittance(const SceneView& scene, const Rays& rays, const TabledLamp& lamp, Vec3 x,
                                     const ConnectingRay& ray, float weight, Pcg32& random) {
  const float found = std::exp(-lamp.table.depthTo(x).r);
  const float check = lamp.checkProbability(weight);
  if (!(random.next() < check)) return found;
  const float exact = std::exp(-opticalDepth(scene, rays, ray.at, ray.tMax).r);
  return found + (exact - found) / check;
}

/// The tables of a scene's lamps, where they are worth their while.
class TabledLamps {
 public:
  TabledLamps() = default;
  /// `side`: of each table (LampTables); 0 for none. A lamp whose table would have to be checked too often has none.
  /// None has where extinction differs between the channels, and none while a stop is asked for.
  TabledLamps(const Scene& scene, int side, const std::stop_token& stop);

  /// One for each emitter, or none at all if no lamp has a table. Points into this object.
  View<TabledLamp> view() const { return viewOf(lamps_); }

 private:
  LampTables tables_;
  std::vector<TabledLamp> lamps_;
};

/// Nodes in either direction that do justice to the scene's grids, as far as they take little memory beside dense ones
/// and little time beside a picture of so many pixels. 0 where there can be no tables.
int tabledLampSide(const Scene& scene, int64_t pixels);

}  // namespace virga
