// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transport/light_walk.h"

namespace virga {

/// VirtualLights, as kernels take them.
struct VirtualLightsView {
  View<LightVertex> lights;
  View<SurfaceScattering> surfaces;  ///< LightVertex::surface counts these
  View<uint32_t> firstOf;            ///< of each walk, the first of its lights; one more entry than walks

  VIRGA_HD int walks() const { return firstOf.size - 1; }
};

/// Intensity of one of them toward w, the cosine at a surface left out [W/sr].
VIRGA_HD inline Rgb intensity(const VirtualLightsView& lights, const SceneView& scene, const LightVertex& light,
                              Vec3 w) {
  if (light.kind == VertexKind::surface && light.surface < 0) return dot(w, light.normal) > 0 ? light.weight : Rgb();
  if (light.kind == VertexKind::surface) return light.weight * lights.surfaces[light.surface].scattering(w, light.wi);
  return light.weight * scene.media[light.medium].phaseAt(light.p).value(w, light.wi);
}

}  // namespace virga
