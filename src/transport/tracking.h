// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "core/random.h"
#include "scene/medium.h"
#include "transport/spectral_flight.h"

namespace virga {

/// The part [t0, t1] of a ray that lies in a box; empty where t0 >= t1.
struct ClippedRange {
  float t0, t1;
};

VIRGA_HD inline ClippedRange clipToBox(Vec3 o, Vec3 d, Vec3 lo, Vec3 hi, float t0, float t1) {
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0) {
      if (o[axis] < lo[axis] || o[axis] > hi[axis]) return {t0, t0};
      continue;
    }
    const float inverse = 1 / d[axis];
    const float a = (lo[axis] - o[axis]) * inverse, b = (hi[axis] - o[axis]) * inverse;
    t0 = std::max(t0, std::min(a, b));
    t1 = std::min(t1, std::max(a, b));
  }
  return {t0, t1};
}

/// One axis of a walk through the cells of a grid. It never leaves the grid, whatever rounding does at its border.
struct CellAxis {
  float next;   ///< where the ray crosses the next border, or infinity
  float delta;  ///< from border to border
  int left;     ///< borders that are still ahead
  int stride;   ///< of the cell's index, forward along the ray

  /// `start`: at t0, `origin`: at t = 0, both in cells; `speed` in cells per t. Adds the first cell's part of the
  /// index.
  VIRGA_HD CellAxis(int count, int cellStride, float start, float origin, float speed, int& index) {
    const float inverse = 1 / speed;
    const bool forward = speed > 0;
    const int cell = static_cast<int>(clamp(std::floor(start), 0.f, static_cast<float>(count - 1)));
    index += cell * cellStride;
    stride = forward ? cellStride : -cellStride;
    left = std::isinf(inverse) ? 0 : (forward ? count - 1 - cell : cell);
    delta = std::fabs(inverse);
    next = left > 0 ? (static_cast<float>(forward ? cell + 1 : cell) - origin) * inverse : kInfinity;
  }
  /// Goes to the next cell if its border is not beyond t. Free of branches: which axis comes next is hard to predict.
  VIRGA_HD void advance(float t, int& index) {
    const bool crosses = next <= t;
    index += crosses ? stride : 0;
    left -= crosses ? 1 : 0;
    const float beyond = left > 0 ? next + delta : kInfinity;
    next = crosses ? beyond : next;
  }
};

/// Walks the cells of a majorant grid along o + t d (index coordinates of the fine grid; d of any length) for t in [t0,
/// t1], which lies in the grid's box: visit(a, b, majorant) for each piece, in order, until it returns false. Returns
/// false if it did.
template <class Visit>
VIRGA_HD bool walkMajorants(const CoarseGridView& grid, Vec3 o, Vec3 d, float t0, float t1, Visit&& visit) {
  const Vec3 scale = Vec3(1) / grid.cellSize, origin = (o - grid.origin) * scale, speed = d * scale;
  const Vec3 start = (o + d * t0 - grid.origin) * scale;
  int index = 0;
  CellAxis x(grid.nx, 1, start.x, origin.x, speed.x, index);
  CellAxis y(grid.ny, grid.nx, start.y, origin.y, speed.y, index);
  CellAxis z(grid.nz, grid.nx * grid.ny, start.z, origin.z, speed.z, index);
  for (float t = t0; t < t1;) {
    const float border = std::min(x.next, std::min(y.next, z.next)), end = std::min(border, t1);
    if (end > t && !visit(t, end, grid.values[index])) return false;
    t = std::max(t, end);
    x.advance(border, index);
    y.advance(border, index);
    z.advance(border, index);
  }
  return true;
}

/// Pieces of [t0, t1] along a ray in index coordinates, each with the number of the coarse cell that it lies in;
/// outside the grid's support its background. visit(a, b, number, inside) until it returns false.
template <class Visit>
VIRGA_HD void forEachCoarseCell(const GridView& grid, const CoarseGridView& cells, Vec3 o, Vec3 d, float t0, float t1,
                                Visit&& visit) {
  const ClippedRange in = clipToBox(o, d, grid.supportLo, grid.supportHi, t0, t1);
  const bool meets = in.t0 < in.t1;
  if (grid.background > 0 && !visit(t0, meets ? in.t0 : t1, grid.background, false)) return;
  if (!meets) return;
  if (!walkMajorants(cells, o, d, in.t0, in.t1,
                     [&](float a, float b, float majorant) { return visit(a, b, majorant, true); }))
    return;
  if (grid.background > 0) visit(in.t1, t1, grid.background, false);
}

/// Likewise, each with a bound of the density: visit(a, b, majorant, inside).
template <class Visit>
VIRGA_HD void forEachMajorant(const GridView& grid, Vec3 o, Vec3 d, float t0, float t1, Visit&& visit) {
  forEachCoarseCell(grid, grid.majorant, o, d, t0, t1, visit);
}

/// A ray in the index coordinates of a medium's grid; t stays the same.
struct GridRay {
  Vec3 o, d;
  VIRGA_HD GridRay(const MediumView& medium, const Ray& ray)
      : o(medium.worldToDensity.point(ray.o)), d(medium.worldToDensity.vector(ray.d)) {}
};

VIRGA_HD inline float exponential(Pcg32& random) { return -std::log(1 - random.next()); }

/// A point where a medium may have scattered.
struct TentativeCollision {
  float t;
  Vec3 p;          ///< index coordinates of the density
  float majorant;  ///< of the density there
  bool inside;     ///< the grid's support

  /// Density over majorant, in [0, 1]: the part of such collisions that are real.
  VIRGA_HD float ratio(const MediumView& medium) const {
    return inside ? medium.density.lookupInside(p) / majorant : 1.f;
  }
  VIRGA_HD Rgb ratios(const MediumView& medium) const {
    return medium.densityColors.values ? medium.densityColors.lookup(p) / majorant : Rgb(ratio(medium));
  }
};

/// Tentative collisions along [t0, t1] of a heterogeneous medium: a Poisson process of density majorant * sigmaT.
/// visit(collision) until it returns false; passed(length * majorant) for every piece between them.
template <class Visit, class Passed>
VIRGA_HD void forEachTentativeCollision(const MediumView& medium, float sigmaT, const Ray& ray, float t0, float t1,
                                        Pcg32& random, Visit&& visit, Passed&& passed) {
  const GridRay g(medium, ray);
  float depth = exponential(random);  // optical depth left until the next one
  forEachMajorant(medium.density, g.o, g.d, t0, t1, [&](float a, float b, float majorant, bool inside) {
    const float mu = majorant * sigmaT;
    for (float t = a;;) {
      const float here = (b - t) * mu;
      if (!(depth < here)) {
        depth -= here;
        passed((b - t) * majorant);
        return true;
      }
      t += depth / mu;
      passed(depth / sigmaT);
      if (!visit(TentativeCollision{t, g.o + g.d * t, majorant, inside})) return false;
      depth = exponential(random);
    }
  });
}

struct IgnoreLength {
  VIRGA_HD void operator()(float) const {}
};

/// Delta tracking on local majorants in a grey heterogeneous medium (Woodcock 1965; Szirmay-Kalos et al. 2011): the
/// distance t in [t0, t1) of the next real collision, or infinity. met(t, ratio) at each tentative collision up to that
/// one, and at it: each of them is real with probability `ratio`, and is found with density sigma_t(t) tau(t0, t) /
/// ratio.
template <class Met>
VIRGA_HD float trackFreeFlight(const MediumView& medium, const Ray& ray, float t0, float t1, Pcg32& random, Met&& met) {
  float found = kInfinity;
  const auto visit = [&](const TentativeCollision& c) {
    const float ratio = c.ratio(medium);
    const bool real = random.next() < ratio;
    met(c.t, ratio);
    if (real) found = c.t;
    return !real;
  };
  forEachTentativeCollision(medium, medium.sigmaT, ray, t0, t1, random, visit, IgnoreLength{});
  return found;
}

/// Distance t in [t0, t1) of the next real collision in a grey medium, or infinity: density sigma_t(t) tau(t0, t).
/// Analytic where the medium is homogeneous, otherwise delta tracking.
VIRGA_HD inline float sampleFreeFlight(const MediumView& medium, const Ray& ray, float t0, float t1, Pcg32& random) {
  if (medium.homogeneous) {
    const float t = t0 + exponential(random) / medium.sigmaT;
    return t < t1 ? t : kInfinity;
  }
  return trackFreeFlight(medium, ray, t0, t1, random, [](float, float) {});
}

/// The flight of one channel, the hero's, through a medium of any colour; all that was drawn is noted in `spectral`.
VIRGA_HD inline float sampleFreeFlight(const MediumView& medium, const Ray& ray, float t0, float t1, Pcg32& random,
                                       SpectralFlight& spectral) {
  if (medium.grey) return sampleFreeFlight(medium, ray, t0, t1, random);
  const float sigmaT = medium.sigmaT * medium.spectrum[spectral.hero];
  if (medium.homogeneous) {
    const float t = sigmaT > 0 ? t0 + exponential(random) / sigmaT : kInfinity;
    spectral.note(medium.spectrum, t < t1 ? 1 : 0, (std::min(t, t1) - t0) * medium.sigmaT);
    return t < t1 ? t : kInfinity;
  }
  float found = kInfinity, length = 0;
  int collisions = 0;
  const auto visit = [&](const TentativeCollision& c) {
    const Rgb ratios = c.ratios(medium);
    const bool real = random.next() < ratios[spectral.hero];
    spectral.note(real ? ratios : Rgb(1.f) - ratios);
    ++collisions;
    if (real) found = c.t;
    return !real;
  };
  forEachTentativeCollision(medium, sigmaT, ray, t0, t1, random, visit, [&](float l) { length += l; });
  spectral.note(medium.spectrum, collisions, length * medium.sigmaT);
  return found;
}

/// Below this a transmittance estimate plays Russian roulette.
inline constexpr float kTransmittanceRoulette = 0.1f;

/// Unbiased estimate of tau(t0, t1), each channel in [0, 1]. Analytic where the medium is homogeneous, otherwise ratio
/// tracking (Novak et al. 2014) on local majorants of the densest channel.
VIRGA_HD inline Rgb estimateTransmittance(const MediumView& medium, const Ray& ray, float t0, float t1, Pcg32& random) {
  if (!(medium.sigmaT > 0)) return Rgb(1.f);
  if (medium.homogeneous) {
    const float depth = medium.sigmaT * (t1 - t0);
    if (medium.grey) return Rgb(std::exp(-depth));
    Rgb transmittance(1.f);
    for (int c = 0; c < 3; ++c)  // the depth may be infinite
      if (medium.spectrum[c] > 0) transmittance[c] = std::exp(medium.spectrum[c] * -depth);
    return transmittance;
  }
  Rgb transmittance(1.f);
  const auto visit = [&](const TentativeCollision& c) {
    if (medium.grey)
      transmittance *= 1 - c.ratio(medium);
    else
      transmittance *= Rgb(1.f) - medium.spectrum * c.ratios(medium);
    const float largest = maxComponent(transmittance);
    if (largest >= kTransmittanceRoulette) return true;
    const bool survives = random.next() * kTransmittanceRoulette < largest;
    transmittance *= survives ? kTransmittanceRoulette / largest : 0;
    return survives;
  };
  forEachTentativeCollision(medium, medium.sigmaT, ray, t0, t1, random, visit, IgnoreLength{});
  return transmittance;
}

}  // namespace virga
