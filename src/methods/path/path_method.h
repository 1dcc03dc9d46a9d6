// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "methods/method.h"

namespace virga {

inline constexpr SettingInfo kPathSettings[] = {
    {"max_depth", "the scene's", "longest path in segments, -1 for no limit; 2 is direct light"},
    {"rr_depth", "the scene's", "scattering events before Russian roulette by throughput begins"},
    {"equiangular_depth", "1",
     "segments on which equiangular sampling in homogeneous media aims at all lights, not at small and near ones "
     "alone"},
    {"shared_paths", "true",
     "where one homogeneous medium fills all space, 16 pixels at a time share paths (docs/decisions/shared-paths.md); "
     "false: the pixels' errors are independent"},
};

/// Unidirectional volumetric path tracing: the reference that every other method is held against.
std::unique_ptr<Method> createPath();

}  // namespace virga
