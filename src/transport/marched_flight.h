// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/media_walk.h"

namespace virga {

/// How free flights through heterogeneous media are drawn. Homogeneous media are exact either way.
enum class FlightMode {
  tracking,  ///< delta tracking: exact
  marching,  ///< optical depth added up in small steps: biased by them
};

/// Steps of a march, in cells of the density's grid: the density is nearly linear within.
inline constexpr float kMarchedCells = 0.5f;
/// However long the way through a grid.
inline constexpr float kMostMarchedSteps = 4096;

/// A march for an optical depth that is drawn beforehand, in a medium that is taken to be even within each step, as it
/// is in the step's middle.
class FlightMarch {
 public:
  VIRGA_HD FlightMarch(const MediumView& medium, const Ray& ray, int channel, float depth)
      : medium_(medium), g_(medium, ray), channel_(channel), left_(depth) {}

  /// Goes through [a, b], in which the medium is even; true where the flight ends there.
  VIRGA_HD bool pass(float a, float b, Rgb sigmaT) {
    if (!(a < b)) return false;
    const auto depthOf = [&](float sigma, float way) { return sigma > 0 ? sigma * way : 0; };  // which may be endless
    const float here = depthOf(sigmaT[channel_], b - a);
    const bool ends = left_ < here;
    const float way = ends ? left_ / sigmaT[channel_] : b - a;
    for (int c = 0; c < 3; ++c) passed_[c] += depthOf(sigmaT[c], way);
    left_ -= here;
    if (ends) t_ = a + way, at_ = sigmaT;
    return ends;
  }
  /// The same with the grid's density.
  VIRGA_HD bool march(float a, float b) {
    if (!(a < b)) return false;
    const float steps = clamp(std::ceil((b - a) * length(g_.d) / kMarchedCells), 1, kMostMarchedSteps);
    const float step = (b - a) / steps;
    for (float i = 0; i < steps; ++i)
      if (pass(a + i * step, a + (i + 1) * step, extinction(a + (i + 0.5f) * step))) return true;
    return false;
  }
  VIRGA_HD const GridRay& ray() const { return g_; }
  VIRGA_HD float t() const { return t_; }          ///< infinite where no flight has ended
  VIRGA_HD Rgb passed() const { return passed_; }  ///< optical depth, in every channel
  VIRGA_HD Rgb extinctionAtEnd() const { return at_; }

 private:
  VIRGA_HD Rgb extinction(float t) const {
    const Vec3 q = g_.o + g_.d * t;
    if (medium_.densityColors.values) return medium_.spectrum * medium_.densityColors.lookup(q) * medium_.sigmaT;
    return medium_.spectrum * (medium_.sigmaT * medium_.density.lookupInside(q));
  }

  const MediumView& medium_;
  GridRay g_;
  int channel_;
  float left_, t_ = kInfinity;
  Rgb passed_, at_;
};

/// As sampleFreeFlight(), in heterogeneous media by marching.
template <class... Spectral>
VIRGA_HD float marchFreeFlight(const MediumView& medium, const Ray& ray, float t0, float t1, Pcg32& random,
                               Spectral&... spectral) {
  if (medium.homogeneous) return sampleFreeFlight(medium, ray, t0, t1, random, spectral...);
  int channel = 0;
  ((channel = spectral.hero), ...);
  FlightMarch flight(medium, ray, channel, exponential(random));
  const GridView& grid = medium.density;
  const ClippedRange in = clipToBox(flight.ray().o, flight.ray().d, grid.supportLo, grid.supportHi, t0, t1);
  const bool meets = in.t0 < in.t1;
  const Rgb around = medium.spectrum * (grid.background * medium.sigmaT);
  (grid.background > 0 && flight.pass(t0, meets ? in.t0 : t1, around)) || (meets && flight.march(in.t0, in.t1)) ||
      (meets && grid.background > 0 && flight.pass(in.t1, t1, around));
  [[maybe_unused]] const auto note = [&](SpectralFlight& s) {
    s.note(flight.passed(), 0, 1);
    if (flight.t() < kInfinity) s.note(flight.extinctionAtEnd());
  };
  (note(spectral), ...);
  return flight.t();
}

/// As sampleCollision().
template <class... Spectral>
VIRGA_HD Collision marchCollision(const SceneView& scene, const MediaRay& r, float t0, float t1, Pcg32& random,
                                  Spectral&... spectral) {
  return nearestCollision(r.media, t1, [&](int medium, float end) {
    return marchFreeFlight(scene.media[medium], r.ray, t0, end, random, spectral...);
  });
}

}  // namespace virga
