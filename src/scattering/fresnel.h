// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/rgb.h"

namespace virga {

struct DielectricFresnel {
  float reflectance;
  float cosTransmitted;  ///< of the refracted ray with the normal on the far side, >= 0; 0 at total reflection
  float eta;             ///< index of the far side over the index of the side the ray is on
};

/// Unpolarised reflectance at a smooth interface. cosIncident is signed: > 0 on the outside; eta = inside over outside
/// index.
VIRGA_HD inline DielectricFresnel fresnelDielectric(float cosIncident, float eta) {
  const float relative = cosIncident >= 0 ? eta : 1 / eta;
  const float ci = std::fabs(cosIncident);
  // Snell: cos^2 of the refracted ray, as a difference that is exact for equal indices and at grazing incidence.
  const float ct2 = (ci * ci + (relative - 1) * (relative + 1)) / (relative * relative);
  if (ct2 <= 0) return {1, 0, relative};
  const float ct = std::sqrt(ct2);
  const float parallel = (relative * ci - ct) / (relative * ci + ct);
  const float perpendicular = (ci - relative * ct) / (ci + relative * ct);
  return {0.5f * (parallel * parallel + perpendicular * perpendicular), ct, relative};
}

/// Unpolarised reflectance of a conductor with refractive index eta + i k (relative to the outside), cosIncident in [0,
/// 1].
VIRGA_HD inline float fresnelConductor(float cosIncident, float eta, float k) {
  const float c2 = cosIncident * cosIncident, s2 = 1 - c2;
  const float e2 = eta * eta - k * k - s2;
  const float a2b2 = std::sqrt(e2 * e2 + 4 * eta * eta * k * k);
  const float a = std::sqrt(std::max(0.f, 0.5f * (a2b2 + e2)));
  const float perpendicular = (a2b2 + c2 - 2 * cosIncident * a) / (a2b2 + c2 + 2 * cosIncident * a);
  const float x = c2 * a2b2 + s2 * s2, y = 2 * cosIncident * a * s2;
  return 0.5f * perpendicular * (1 + (x - y) / (x + y));
}

VIRGA_HD inline Rgb fresnelConductor(float cosIncident, Rgb eta, Rgb k) {
  return {fresnelConductor(cosIncident, eta.r, k.r), fresnelConductor(cosIncident, eta.g, k.g),
          fresnelConductor(cosIncident, eta.b, k.b)};
}

}  // namespace virga
