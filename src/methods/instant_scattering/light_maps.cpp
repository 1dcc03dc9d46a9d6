// SPDX-License-Identifier: Apache-2.0
#include "methods/instant_scattering/light_maps.h"

#include <algorithm>
#include <bit>

#include "core/parallel.h"
#include "methods/instant_scattering/light_visibility.h"

namespace virga {

LightMaps::Place LightMaps::placeOf(const LightVertex& l) {
  return {l.p.x, l.p.y, l.p.z, l.normal.x, l.normal.y, l.normal.z};
}

LightMaps::LightMaps(const Scene& scene, std::span<const LightVertex> lights, const Options& options,
                     const LightMaps* before, const std::stop_token& stop)
    : side_(options.resolution), depths_(lights.size() * texels()) {
  std::vector<LightVertex> drawn;
  std::vector<size_t> numbers;  // of these
  for (size_t i = 0; i < lights.size(); ++i) {
    const Place place = placeOf(lights[i]);
    numbers_[place] = i;
    const auto known = before ? before->numbers_.find(place) : numbers_.end();
    if (before && known != before->numbers_.end())
      std::copy_n(&before->depths_[known->second * texels()], texels(), &depths_[i * texels()]);
    else
      drawn.push_back(lights[i]), numbers.push_back(i);
  }
  const ShadowMapOptions map{.resolution = options.resolution};
  const ShadowMaps maps = options.points > 0
                              ? ShadowMaps(SurfacePoints(scene.view, options.points, 0), drawn, map, stop)
                              : ShadowMaps(*scene.surfaceRays, mapOffset(scene.view), drawn, map, stop);
  // In floats: no vector code gathers halves of words.
  parallelFor(static_cast<int64_t>(drawn.size()), 1, [&](int64_t n) {
    const size_t from = static_cast<size_t>(n) * texels(), to = numbers[static_cast<size_t>(n)] * texels();
    for (size_t i = 0; i < texels(); ++i)
      depths_[to + i] = std::bit_cast<float>(static_cast<uint32_t>(maps.view().depths[from + i]) << 16);
  });
}

KernelShadowMap LightMaps::map(size_t i) const {
  return {&depths_[i * texels()], side_, ShadowMapsView::kBias * 2 / static_cast<float>(side_),
          ShadowMapsView::kLeastCosine};
}

}  // namespace virga
