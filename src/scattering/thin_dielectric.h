// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scattering/bsdf_sample.h"
#include "scattering/fresnel.h"

namespace virga {

/// A pane so thin that its two smooth interfaces are one place: light goes straight through or is mirrored, after any
/// number of reflections inside.
struct ThinDielectric {
  static constexpr int kColors = 2;
  float eta;  ///< index of the pane over that around it
  Rgb reflectance, transmittance;

  VIRGA_HD Rgb& color(int i) { return i == 0 ? reflectance : transmittance; }
  /// R + T R T + T R^3 T + ... with T = 1 - R.
  VIRGA_HD float reflectedShare(float cosine) const {
    const float r = fresnelDielectric(std::fabs(cosine), eta).reflectance;
    return 2 * r / (1 + r);
  }
  /// What goes straight through.
  VIRGA_HD Rgb straight(float cosine) const { return transmittance * (1 - reflectedShare(cosine)); }
  VIRGA_HD BsdfSample sample(Vec3 wo, Vec2, float choice) const {
    const float r = reflectedShare(wo.z);
    if (choice < r) return {Vec3(-wo.x, -wo.y, wo.z), reflectance, r, true, 1};
    return {-wo, transmittance, 1 - r, true, 1};
  }
};

}  // namespace virga
