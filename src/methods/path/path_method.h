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
    {"lamp_table", "0; 1.5 for each voxel where media are grids, at most 256 and as many as take little memory",
     "nodes along the edges of tables of what media let through from point and spot lamps, by which light is gathered "
     "all along free flights (docs/decisions/flight-light.md); 0 for none"},
};

/// Unidirectional volumetric path tracing: the reference that every other method is held against.
std::unique_ptr<Method> createPath();

}  // namespace virga
