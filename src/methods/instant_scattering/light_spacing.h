// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "core/vec.h"
#include "methods/instant_scattering/frame_kernels.h"

namespace virga {

/// A light, as far as its neighbours count.
struct PlacedLight {
  Vec3 p;
  float weight;  ///< >= 0
};

/// For each light the radius of the ball around it in which the lights, itself included, weigh `times` as much as it
/// does [unit]. At most `most` neighbours are counted; fewer lights than asked for: as if they went on as densely, in a
/// space of `dimensions`. 0 where all that are counted lie in one place.
std::vector<float> radiiOfNeighbours(std::span<const PlacedLight> lights, float times, int most, int dimensions);

/// NearField::core for which a ball whose radius is `depth` mean free paths of a medium sends as much light to the
/// medium within it as its middle would through what lies between; 7 in vacuum. Error 1e-3.
float coreFor(float depth);

/// A light's ball: its radius [unit] and NearField::core.
struct LightBall {
  float radius;
  KernelRgb core;
};

/// The ball of a light in a medium, between `least` and all of `radius` wide, that sends as much light to the media
/// within it as its middle would. A ball that would have to be brighter in its middle than `mostCore` for that, because
/// it is wider than the smoke that it lies in or many mean free paths deep, is made smaller, down to `least`. `media`:
/// optical depths all around the light (DepthView::stretch is 1), of each channel or one for all. The light's own
/// directions are those of its g.
LightBall ballWithin(std::span<const DepthTable> media, const KernelLight& light, float radius, float least,
                     float mostCore);

}  // namespace virga
