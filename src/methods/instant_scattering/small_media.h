// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "methods/instant_scattering/pixel_features.h"
#include "scene/scene.h"

namespace virga {

/// Makes pixels irregular that show parts of the media which are small beside the filter's cells, `spacing` pixels
/// wide: what few coarse pixels see says little of the others, so these are computed by themselves. A part lies apart
/// from the others (boxesOfMedia()) and shows within 16 cells. `features`: those of `width` x `height` pixels, row by
/// row.
void setSmallMediaApart(const Scene& scene, int spacing, int width, int height, std::span<PixelFeatures> features);

}  // namespace virga
