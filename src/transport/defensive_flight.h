// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/media_walk.h"

namespace virga {

/// The part of a ray that lies in one medium. Of media that overlap, each has its own.
struct MediaPiece {
  float t0, t1;
  int medium;
};

/// What DefensiveFlight has to know of a medium besides its coefficients. Rates are positive, or 0 for `evenRate`.
struct DefensiveRates {
  float thinRate = 0;  ///< one over the extent of the medium [1/unit]
  float evenRate = 0;  ///< mean of sigma_t where it is not 0 [1/unit]
};

/// Free flights whose density is known as a number and is positive wherever there may ever be a medium, so that what
/// they find can be weighed again when the media change (docs/decisions/kept-walks.md). A mixture, chosen once for each
/// flight: an exponential flight by the local mean of sigma_t, of one channel out of three; or one in which each medium
/// is even throughout the shapes that it fills, as dense as it is on average; or one in which it is thin.
class DefensiveFlight {
 public:
  static constexpr float kEvenShare = 0.25f, kThinShare = 0.25f, kOwnShare = 1 - kEvenShare - kThinShare;

  /// `rates` of the scene's media.
  VIRGA_HD DefensiveFlight(const SceneView& scene, View<DefensiveRates> rates, Pcg32& random)
      : scene_(scene), rates_(rates) {
    const float choice = random.next();
    const int channel = std::min(2, static_cast<int>(3 * random.next()));
    by_ = choice < kThinShare ? kThin : choice < kThinShare + kEvenShare ? kEven : channel;
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
      const float density = pass(medium, r.ray, t0, end);
      if (medium == nearest.medium) density_ = density;
      piece(MediaPiece{t0, end, medium});
    }
    return nearest;
  }

  /// How likely the flight was to come as far as it did.
  VIRGA_HD float survival() const {
    return kOwnShare * mean(exp(depth_ * -1.f)) + kEvenShare * std::exp(-evenDepth_) +
           kThinShare * std::exp(-thinDepth_);
  }
  /// Density with which it collides here [1/unit].
  VIRGA_HD float collisionPdf(int medium) const {
    const DefensiveRates& r = rates_[medium];
    const Rgb own = scene_.media[medium].spectrum * (scene_.media[medium].sigmaT * density_);
    return kOwnShare * mean(own * exp(depth_ * -1.f)) + kEvenShare * r.evenRate * std::exp(-evenDepth_) +
           kThinShare * r.thinRate * std::exp(-thinDepth_);
  }

 private:
  /// What is flown by, if not by a channel.
  static constexpr int kEven = -1, kThin = -2;

  VIRGA_HD static float mean(Rgb c) { return (c.r + c.g + c.b) / 3; }

  /// Pieces with the local mean of the density: visit(a, b, density) until it returns false; where it is 0, perhaps
  /// not.
  template <class Visit>
  VIRGA_HD static void forEachMean(const MediumView& medium, const Ray& ray, float t0, float t1, Visit&& visit) {
    if (medium.homogeneous) {
      visit(t0, t1, 1.f);
      return;
    }
    const GridRay g(medium, ray);
    forEachCoarseCell(medium.density, medium.density.mean, g.o, g.d, t0, t1,
                      [&](float a, float b, float density, bool) { return visit(a, b, density); });
  }

  /// Distance of a collision with one medium, or infinity.
  VIRGA_HD float sample(int index, const Ray& ray, float t0, float t1, Pcg32& random) const {
    const MediumView& medium = scene_.media[index];
    float depth = exponential(random), found = kInfinity;
    if (by_ == kThin) return t0 + depth / rates_[index].thinRate;
    if (by_ == kEven) return rates_[index].evenRate > 0 ? t0 + depth / rates_[index].evenRate : kInfinity;
    const float sigmaT = medium.sigmaT * medium.spectrum[by_];
    forEachMean(medium, ray, t0, t1, [&](float a, float b, float density) {
      const float here = density * sigmaT > 0 ? density * sigmaT * (b - a) : 0;
      if (depth < here) found = a + depth / (density * sigmaT);
      depth -= here;
      return depth >= 0;
    });
    return found;
  }

  /// Adds the optical depths of one medium; returns the mean density at the end.
  VIRGA_HD float pass(int index, const Ray& ray, float t0, float t1) {
    const MediumView& medium = scene_.media[index];
    float density = 0, depth = 0, last = t0;
    forEachMean(medium, ray, t0, t1, [&](float a, float b, float here) {
      density = here, last = b;
      depth += here > 0 ? here * (b - a) : 0;
      return true;
    });
    for (int c = 0; c < 3; ++c)
      if (medium.sigmaT * medium.spectrum[c] > 0) depth_[c] += medium.sigmaT * medium.spectrum[c] * depth;
    if (rates_[index].evenRate > 0) evenDepth_ += rates_[index].evenRate * (t1 - t0);
    thinDepth_ += rates_[index].thinRate * (t1 - t0);
    return last < t1 ? 0 : density;
  }

  const SceneView& scene_;
  View<DefensiveRates> rates_;
  int by_;     ///< a channel, kEven or kThin
  Rgb depth_;  ///< optical, by the local means
  float evenDepth_ = 0, thinDepth_ = 0;
  float density_ = 0;  ///< mean, where the flight collided
};

}  // namespace virga
