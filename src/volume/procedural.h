// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "volume/dense_volume.h"

namespace virga {

enum class ProceduralKind {
  smoke,  ///< a turbulent plume that rises from a small source
  cloud,  ///< a cumulus: billows with sharp edges on a flat base
  fog,    ///< fog on the ground, thinner with height, with drifting banks
  dust    ///< thin, fills the box, denser at the floor
};

struct ProceduralSettings {
  int resolution = 128;  ///< voxels per edge of the cube, 2 to 2048
  uint32_t seed = 0;
  float frame = 0;  ///< time in frames of 1/24 s; a sequence is frames 0, 1, 2...
};

/// Values in [0, 1] on a cube that fills [-1, 1]^3 of the world, y up. A function of its arguments alone: neither the
/// number of threads nor earlier frames matter. Throws Error on a resolution out of range or a frame that is not
/// finite.
DenseVolume makeProcedural(ProceduralKind kind, const ProceduralSettings& settings);

/// "smoke", "cloud", "fog", "dust"
const std::vector<std::string>& proceduralNames();
/// Throws Error, with the nearest name, on an unknown one.
ProceduralKind proceduralKind(std::string_view name);

}  // namespace virga
