// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/light_visibility.h"

#include <fmt/format.h>

#include "core/error.h"
#include "core/parallel.h"

namespace virga {

void refuseTooManyMaps(size_t lights, int resolution, std::string_view fewer) {
  const size_t memory = ShadowMaps::memory(lights, resolution);
  if (memory > LightVisibilityOptions::kMostMemory)
    throw Error(fmt::format("shadow maps of {} virtual lights would take {:.1f} GB of memory", lights,
                            static_cast<double>(memory) * 1e-9),
                {{}, fmt::format("ask for fewer --set ims.{}, or a smaller ims.map_resolution", fewer), {}});
}

LightVisibility::LightVisibility(const Scene& scene, const VirtualLights& lights, const SurfacePoints& points,
                                 const LightVisibilityOptions& options, uint64_t seed, const std::stop_token& stop)
    : mode_(options.mode) {
  using Mode = LightVisibilityOptions::Mode;
  if (mode_ == Mode::minimumDepth) minimumDepths_ = virga::minimumDepths(*scene.surfaceRays, lights.lights, stop);
  if (mode_ != Mode::shadowMap) return;
  refuseTooManyMaps(lights.lights.size(), options.resolution, "walks");
  const ShadowMapOptions map{.resolution = options.resolution, .seed = seed};
  maps_ = options.points > 0 ? ShadowMaps(points, lights.lights, map, stop)
                             : ShadowMaps(*scene.surfaceRays, mapOffset(scene.view), lights.lights, map, stop);
}

std::vector<float> minimumDepths(const RayScene& surfaces, std::span<const LightVertex> lights,
                                 const std::stop_token& stop) {
  std::vector<float> depths(lights.size());
  parallelFor(static_cast<int64_t>(lights.size()), 64, [&](int64_t i) {
    if (stop.stop_requested()) return;
    const LightVertex& light = lights[static_cast<size_t>(i)];
    const Vec3 sides[] = {light.normal, -light.normal};
    // Lambertian lights, whose surface is not kept, shine to one side.
    const size_t shines = light.kind == VertexKind::medium ? 0 : (light.surface < 0 ? 1 : 2);
    // less than the distance, by the errors of coordinates
    const float d = surfaces.clearance(light.p, std::span(sides).first(shines));
    depths[static_cast<size_t>(i)] = std::max(0.f, d * (1 - 1e-5f) - 1e-5f * maxComponent(abs(light.p)));
  });
  return depths;
}

}  // namespace virga
