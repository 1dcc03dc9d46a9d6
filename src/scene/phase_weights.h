// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/transform.h"
#include "scattering/phase.h"
#include "volume/grid_view.h"

namespace virga {

/// Splits the weight of some lobes of a mixture: the first ones of them share 1 - weight, the others weight.
struct PhaseBlend {
  int first = 0, middle = 0, last = 0;  ///< lobes [first, middle) and [middle, last)
  GridView weight;                      ///< in [0, 1]
  Affine worldToWeight;                 ///< world to index coordinates of the weight

  VIRGA_HD float weightAt(Vec3 p) const { return clamp(weight.lookup(worldToWeight.point(p)), 0.f, 1.f); }
};

/// The weights of a mixture's lobes, from nested blends. Empty: they are the same everywhere.
struct PhaseBlends {
  const PhaseBlend* data = nullptr;
  int size = 0;

  VIRGA_HD PhaseMixture at(Vec3 p, PhaseMixture mixture) const {
    for (int i = 0; i < mixture.count; ++i) mixture.weights[i] = 1;
    for (int b = 0; b < size; ++b) {
      const PhaseBlend& blend = data[b];
      const float weight = blend.weightAt(p);
      for (int i = blend.first; i < blend.last; ++i) mixture.weights[i] *= i < blend.middle ? 1 - weight : weight;
    }
    return mixture;
  }
  friend bool operator==(const PhaseBlends&, const PhaseBlends&) = default;
};

}  // namespace virga
