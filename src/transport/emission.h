// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/tracking.h"

namespace virga {

/// Unbiased estimate of the light that a medium adds along [t0, t1] [W/(m^2 sr)]; what is absorbed on the way is not
/// looked at. Exact where it glows evenly, otherwise one point in each coarse cell that is not dark.
VIRGA_HD inline Rgb estimateEmission(const MediumView& medium, const Ray& ray, float t0, float t1, Pcg32& random) {
  if (!medium.emits) return {};
  if (medium.glowsEvenly) return medium.emission * (t1 - t0);
  const Vec3 o = medium.worldToEmission.point(ray.o), d = medium.worldToEmission.vector(ray.d);
  Rgb sum;
  forEachMajorant(medium.emissionGrid, o, d, t0, t1, [&](float a, float b, float majorant, bool inside) {
    if (!(majorant > 0)) return true;
    const Vec3 p = o + d * lerp(a, b, random.next());
    const Rgb here = medium.emissionColors.values ? medium.emissionColors.lookup(p)
                     : inside                     ? Rgb(medium.emissionGrid.lookupInside(p))
                                                  : Rgb(majorant);
    sum += here * (b - a);
    return true;
  });
  return medium.emission * sum;
}

}  // namespace virga
