// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/brute_force_math.h"

namespace virga::testing::brute {

inline Vector middle(const Region& r) { return (r.lo + r.hi) * 0.5; }
inline double radiusOf(const Region& r) { return (r.hi.x - r.lo.x) / 2; }

/// Do the media take the channels away at different rates?
bool chromatic(const World& world);

/// A collision with the medium of a region; without a region, none.
struct Event {
  double t = kNever;
  const Region* region = nullptr;
};

/// Light that media add at one random point of a line, times the length that the point stands for.
struct Glow {
  double t = kNever;
  Vector light = {};
};

/// All media of a world, as one of the channels sees them.
class Media {
 public:
  Media(const World& world, int channel);

  /// Delta tracking under one majorant.
  Event collide(const Line& line, double end, Random& random) const;
  Glow glow(const Line& line, double end, Random& random) const;

 private:
  double lastPlace(const Line& line, double end) const;

  const World& world_;
  int channel_;
  double majorant_ = 0;  ///< [1/unit]
  double radius_ = 0;    ///< of a ball around all media, its centre the origin
  bool glows_ = false;
};

/// Scatters light at a collision: the line becomes that of the new direction, the throughput what is left of it.
void scatter(const Event& event, Line& line, Vector& throughput, Random& random);

}  // namespace virga::testing::brute
