// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/method.h"

namespace virga {

inline constexpr SettingInfo kImsSettings[] = {
    {"walks", "8192", "random walks from the lights in each pass"},
    {"lights", "4", "virtual lights that are connected to each vertex of an eye path"},
    {"radius", "the scene's extent / 10", "distance within which virtual lights are clamped and compensated [unit]"},
    {"max_depth", "the scene's", "longest path in segments, -1 for no limit; 2 is direct light"},
    {"rr_depth", "the scene's", "scattering events of the eye path before Russian roulette by throughput begins"},
};

/// Instant multiple scattering: virtual point lights in media, with bias compensation.
std::unique_ptr<Method> createIms();

}  // namespace virga
