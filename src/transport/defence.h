// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "scene/scene.h"
#include "transport/defensive_flight.h"

namespace virga {

/// What DefensiveFlight needs of a scene's media: their rates, and what these point to. The scene must outlive it.
struct Defence {
  std::vector<DefensiveRates> rates;
  std::vector<std::vector<float>> spread;
};

/// sigma_t of each medium where it is not 0, on average [1/unit].
std::vector<Rgb> meanExtinctions(const Scene& scene);

/// `extinctions` are those of the scene.
Defence defenceOf(const Scene& scene, const std::vector<Rgb>& extinctions);

/// Have media become so dense, by their mean extinctions, that walks which were drawn in them before are too noisy to
/// be kept? It is the media that decide, not what the walks found: that would bias what they tell.
bool outgrown(const std::vector<Rgb>& now, const std::vector<Rgb>& then);

/// What share of the extinction has come or gone, in [0, 1], of the medium that changes most. Both scenes have the same
/// media, in the same places.
float changeOfMedia(const Scene& before, const Scene& next);

}  // namespace virga
