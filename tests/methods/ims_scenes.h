// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace virga::testing {

// Scenes of size x size pixels, as elements; the camera stands at x.

/// A plume over a floor, beside a block, under a point light.
std::string plume(int size, float x = 0);

/// Its smoke declared by the sensor, whose camera is at z on the axis, and by a small cube in the middle: it is around
/// everything unless the camera is in the cube. Without floor and block.
std::string endlessPlume(int size, double z);

/// The smoke around everything, with a floor and a wall that reach less far than it does.
std::string openPlume(int size, const std::string& lights);

/// Fog in a room with a lamp on the ceiling and a ball of `bsdf`.
std::string fog(int size, const std::string& bsdf = R"(<bsdf type="diffuse"/>)", float x = 0);

}  // namespace virga::testing
