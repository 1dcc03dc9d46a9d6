// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/rgb.h"
#include "core/transform.h"
#include "scene/phase_weights.h"
#include "volume/grid_view.h"

namespace virga {

/// A participating medium: sigma_t(x) = sigmaT * spectrum * density(x) [1/unit], and light that it emits itself.
struct MediumView {
  float sigmaT = 0;         ///< [1/unit] at density 1, of the channel where it is greatest
  Rgb spectrum{1, 1, 1};    ///< sigma_t of each channel, relative to that
  bool grey = true;         ///< sigma_t is the same for all channels, everywhere
  bool homogeneous = true;  ///< density is 1 everywhere
  GridView density;
  RgbGridView
      densityColors;      ///< where it holds values they are the density, channel by channel, and `density` bounds them
  Affine worldToDensity;  ///< world to index coordinates of the density

  Rgb albedo{0.75f, 0.75f, 0.75f};
  RgbGridView albedoGrid;  ///< where it holds values they take the place of `albedo`
  Affine worldToAlbedo;

  PhaseFunction phase;
  PhaseBlends phaseBlends;  ///< of a mixture whose weights are not the same everywhere

  Rgb emission;  ///< radiance that a unit of length adds [W/(m^2 sr) / unit], times the grid's value if there is one
  bool emits = false;       ///< anywhere
  bool glowsEvenly = true;  ///< there is no grid
  GridView emissionGrid;
  RgbGridView emissionColors;  ///< as densityColors
  Affine worldToEmission;      ///< world to index coordinates of the emission

  VIRGA_HD Rgb sigmaTAt(Vec3 p) const {
    if (homogeneous) return spectrum * sigmaT;
    const Vec3 q = worldToDensity.point(p);
    if (!densityColors.values) return spectrum * (sigmaT * density.lookup(q));
    return density.supports(q) ? spectrum * densityColors.lookup(q) * sigmaT : Rgb();
  }
  /// Optical depth of a stretch: its length times the density on it, which may be without end [unit]. A channel that
  /// the medium is clear in stays clear.
  VIRGA_HD Rgb depthOf(Rgb length) const {
    Rgb depth;
    for (int c = 0; c < 3; ++c)
      if (spectrum[c] > 0) depth[c] = spectrum[c] * sigmaT * length[c];
    return depth;
  }
  /// Mean of sigma_t over the channels and the cell of the downsampled grid that p lies in [1/unit].
  VIRGA_HD float localMeanSigmaT(Vec3 p) const {
    const float unit = sigmaT * (spectrum.r + spectrum.g + spectrum.b) / 3;
    return homogeneous ? unit : unit * density.localMean(worldToDensity.point(p));
  }
  VIRGA_HD Rgb albedoAt(Vec3 p) const { return albedoGrid.values ? albedoGrid.lookup(worldToAlbedo.point(p)) : albedo; }
  VIRGA_HD PhaseFunction phaseAt(Vec3 p) const {
    return phaseBlends.size == 0 ? phase : PhaseFunction(phaseBlends.at(p, *phase.get<PhaseMixture>()));
  }
};

/// What a boundary says about the media on its two sides; indices into the scene's media, kNone is vacuum.
struct MediumTransition {
  static constexpr int kNone = -1;
  int interior = kNone, exterior = kNone;
  bool replaces = false;  ///< the declared side takes the place of all that was there; otherwise the interior is added
  bool closed = true;     ///< it has an inside

  VIRGA_HD bool declared() const { return replaces || interior != kNone; }
};

enum class Passing : uint8_t { inward, outward };

/// Which media a point lies in. Two mechanisms (docs/scene-format.md): a boundary that *replaces* sets the base medium;
/// closed null boundaries *add* their interior while the point is inside them. Applying a crossing twice changes
/// nothing, so double hits on shared edges and coplanar faces do no harm.
class MediaState {
 public:
  static constexpr int kCapacity = 8;
  static constexpr int kNone = MediumTransition::kNone;

  VIRGA_HD void setBase(int medium) { base_ = medium, exclusive_ = false, hidden_ = 0; }
  VIRGA_HD int base() const { return base_; }

  /// Passing a boundary that replaces.
  VIRGA_HD void pass(const MediumTransition& boundary, Passing way) {
    if (way == Passing::inward)
      replace(boundary.interior);
    else
      returnTo(boundary.exterior);
  }
  /// Into a shape that replaces: its medium, or vacuum, hides all others around it.
  VIRGA_HD void replace(int medium) { base_ = medium, exclusive_ = medium != kNone, hidden_ = count_; }
  /// Out of it. If its exterior is one of the media in which it lies, or not declared, all those are there again: what
  /// is where must not depend on the way.
  VIRGA_HD void returnTo(int medium) {
    base_ = medium, exclusive_ = false, hidden_ = 0;
    exclusive_ = baseCounts();
  }
  /// Entering additive boundary `boundary` whose interior is `medium`. Those beyond the capacity are left out; the
  /// builder warns of them.
  VIRGA_HD void enter(int boundary, int medium) {
    for (int i = 0; i < count_; ++i)
      if (inside_[i].boundary == boundary) return;
    if (count_ < kCapacity) inside_[count_++] = {boundary, medium};
  }
  VIRGA_HD void leave(int boundary, int medium) {
    int kept = 0, hidden = 0;
    for (int i = 0; i < count_; ++i) {
      if (inside_[i].boundary == boundary) continue;
      hidden += i < hidden_ ? 1 : 0;
      inside_[kept++] = inside_[i];
    }
    count_ = kept, hidden_ = hidden;
    if (base_ == medium) returnTo(kNone);
  }

  /// Media whose coefficients add up here.
  VIRGA_HD int count() const {
    if (exclusive_) return 1;
    return count_ - hidden_ + (baseCounts() ? 1 : 0);
  }
  VIRGA_HD int medium(int i) const {
    if (exclusive_) return base_;
    return hidden_ + i < count_ ? inside_[hidden_ + i].medium : base_;
  }
  VIRGA_HD bool vacuum() const { return count() == 0; }

 private:
  struct Inside {
    int32_t boundary, medium;
  };

  // A base medium that is the interior of a boundary we are in was declared twice (a camera inside a cloud that names
  // the cloud's medium): it counts once.
  VIRGA_HD bool baseCounts() const {
    if (base_ == kNone) return false;
    for (int i = 0; i < count_; ++i)
      if (inside_[i].medium == base_) return false;
    return true;
  }

  int base_ = kNone;
  bool exclusive_ = false;
  int count_ = 0;
  int hidden_ = 0;  ///< of the first ones: around a shape that replaces by vacuum
  Inside inside_[kCapacity];
};

}  // namespace virga
