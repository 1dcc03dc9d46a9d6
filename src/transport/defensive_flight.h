// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/optical_depth.h"

namespace virga {

/// The part of a ray that lies in one medium. Of media that overlap, each has its own.
struct MediaPiece {
  float t0, t1;
  int medium;
};

/// What DefensiveFlight has to know of a medium besides its coefficients.
struct DefensiveRates {
  float thinRate = 0;     ///< one over the extent of the medium [1/unit]; > 0
  float evenRate = 0;     ///< of the order of the mean of sigma_t where it is not 0 [1/unit]
  float spreadRate = 0;   ///< sigma_t at a density of 1, mean of the channels [1/unit]
  CoarseGridView spread;  ///< local means of the density, of more cells than one; no values: none
};

/// Density of a flight if it was drawn from sigma_t itself, and if it was drawn defensively [1/unit], or both as
/// probabilities to arrive.
struct FlightDensity {
  float own, wary;
};

/// Density of a walk's flights. Of all walks a part is drawn from sigma_t alone, flight by flight; the others are wary.
/// How likely a walk is one of either kind changes with each flight that it is seen to take, and in a medium that has
/// not changed its weight stays below 1 / kOwnWalks, however often it scatters.
class WalkDensity {
 public:
  static constexpr float kOwnWalks = 0.5f;

  /// Takes one more flight in: one over its density, given those before; 0 where that is too small to be told.
  VIRGA_HD float inverse(const FlightDensity& flight) {
    const float all = own_ * flight.own + wary_ * flight.wary;
    if (!(all > 0)) return 0;
    own_ *= flight.own / all, wary_ *= flight.wary / all;
    return 1 / all;
  }

 private:
  float own_ = kOwnWalks, wary_ = 1 - kOwnWalks;
};

/// Free flights whose density is known as a number and is positive wherever there may ever be a medium, so that what
/// they find can be weighed again when the media change (docs/decisions/kept-walks.md). A mixture, chosen once for each
/// flight: one by sigma_t itself, of one channel out of three; or by its local mean as it is after spreading to the
/// cells around, with a floor that is even throughout the shapes that the medium fills; or one in which the medium is
/// even and thin.
class DefensiveFlight {
 public:
  static constexpr float kSpreadShare = 0.5f, kThinShare = 0.25f, kOwnShare = 1 - kSpreadShare - kThinShare;

  enum class Walk { own, wary };  ///< own: of a walk whose flights are all drawn from sigma_t

  /// `rates` of the scene's media.
  VIRGA_HD DefensiveFlight(const SceneView& scene, View<DefensiveRates> rates, Walk walk, Pcg32& random)
      : scene_(scene), rates_(rates) {
    const float choice = random.next();
    const int channel = std::min(2, static_cast<int>(3 * random.next()));
    by_ = channel;
    if (walk == Walk::wary && choice < kThinShare + kSpreadShare) by_ = choice < kThinShare ? kThin : kSpread;
  }

  /// Goes on through [t0, t1] of the media of the state; pieces come in the order of the ray. piece(MediaPiece) for
  /// each that was passed. Returns the collision, if there is one: afterwards the flight is there.
  template <class Piece>
  VIRGA_HD Collision fly(const MediaRay& r, float t0, float t1, Pcg32& random, Piece&& piece) {
    Collision nearest;
    for (int i = 0; i < r.media.count(); ++i) {
      const int medium = r.media.medium(i);
      const float end = std::min(t1, nearest.t), t = sample(medium, r.ray, t0, end, random);
      if (t < end) nearest = {t, medium};
    }
    const float end = std::min(t1, nearest.t);
    for (int i = 0; i < r.media.count(); ++i) {
      const int medium = r.media.medium(i);
      const float spread = pass(medium, r.ray, t0, end);
      if (medium == nearest.medium) own_ = scene_.media[medium].sigmaTAt(r.ray.at(end)), spread_ = spread;
      piece(MediaPiece{t0, end, medium});
    }
    return nearest;
  }

  /// How likely the flight was to come as far as it did.
  VIRGA_HD FlightDensity survival() const {
    const float own = mean(exp(depth_ * -1.f));
    return {own, kOwnShare * own + kSpreadShare * std::exp(-spreadDepth_) + kThinShare * std::exp(-thinDepth_)};
  }
  /// Density with which it collides here.
  VIRGA_HD FlightDensity collision(int medium) const {
    const DefensiveRates& r = rates_[medium];
    const float own = mean(own_ * exp(depth_ * -1.f)), spread = r.evenRate + r.spreadRate * spread_;
    return {own, kOwnShare * own + kSpreadShare * spread * std::exp(-spreadDepth_) +
                     kThinShare * r.thinRate * std::exp(-thinDepth_)};
  }

 private:
  /// What is flown by, if not by a channel.
  static constexpr int kSpread = -1, kThin = -2;

  VIRGA_HD static float mean(Rgb c) { return (c.r + c.g + c.b) / 3; }

  /// Pieces with means of the density, of length above 0: visit(a, b, density) until it returns false; where it is 0,
  /// perhaps not.
  template <class Visit>
  VIRGA_HD static void forEachMean(const MediumView& medium, const CoarseGridView& cells, const Ray& ray, float t0,
                                   float t1, Visit&& visit) {
    const GridRay g(medium, ray);
    forEachCoarseCell(medium.density, cells, g.o, g.d, t0, t1,
                      [&](float a, float b, float density, bool) { return !(a < b) || visit(a, b, density); });
  }

  /// Distance of a collision in [t0, t1] where sigma_t is `sigmaT` times the means, or infinity.
  VIRGA_HD static float sampleByMeans(const MediumView& medium, const CoarseGridView& cells, float sigmaT,
                                      const Ray& ray, float t0, float t1, Pcg32& random) {
    float depth = exponential(random), found = kInfinity;
    forEachMean(medium, cells, ray, t0, t1, [&](float a, float b, float density) {
      const float here = density * sigmaT > 0 ? density * sigmaT * (b - a) : 0;
      if (depth < here) found = a + depth / (density * sigmaT);
      depth -= here;
      return depth >= 0;
    });
    return found;
  }

  /// Distance of a collision with one medium, or infinity.
  VIRGA_HD float sample(int index, const Ray& ray, float t0, float t1, Pcg32& random) const {
    const MediumView& medium = scene_.media[index];
    const DefensiveRates& r = rates_[index];
    if (by_ >= 0) return distanceOfDepth(medium, by_, exponential(random), ray, t0, t1);
    const float rate = by_ == kThin ? r.thinRate : r.evenRate;
    const float even = rate > 0 ? t0 + exponential(random) / rate : kInfinity;
    if (by_ == kThin || !r.spread.values) return even;
    return std::min(even, sampleByMeans(medium, r.spread, r.spreadRate, ray, t0, t1, random));
  }

  /// The mean density at the end of [t0, t1], 0 where that is outside; adds up all of it [unit].
  VIRGA_HD static float sumMeans(const MediumView& medium, const CoarseGridView& cells, const Ray& ray, float t0,
                                 float t1, float& sum) {
    float density = 0, last = t0;
    forEachMean(medium, cells, ray, t0, t1, [&](float a, float b, float here) {
      density = here, last = b;
      sum += here > 0 ? here * (b - a) : 0;
      return true;
    });
    return last < t1 ? 0 : density;
  }

  /// Adds the optical depths of one medium; returns the mean that is spread at the end.
  VIRGA_HD float pass(int index, const Ray& ray, float t0, float t1) {
    const MediumView& medium = scene_.media[index];
    const DefensiveRates& r = rates_[index];
    float spread = 0, here = 0;
    if (r.spread.values) here = sumMeans(medium, r.spread, ray, t0, t1, spread);
    depth_ += opticalDepth(medium, ray, t0, t1);
    if (r.evenRate > 0) spreadDepth_ += r.evenRate * (t1 - t0);
    if (spread > 0) spreadDepth_ += r.spreadRate * spread;
    thinDepth_ += r.thinRate * (t1 - t0);
    return here;
  }

  const SceneView& scene_;
  View<DefensiveRates> rates_;
  int by_;     ///< a channel, kSpread or kThin
  Rgb depth_;  ///< optical
  float spreadDepth_ = 0, thinDepth_ = 0;
  Rgb own_;           ///< sigma_t where the flight collided [1/unit]
  float spread_ = 0;  ///< mean of the density there, spread
};

}  // namespace virga
