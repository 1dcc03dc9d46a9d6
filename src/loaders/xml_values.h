// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/rgb.h"
#include "core/vec.h"
#include "loaders/xml_argument.h"

namespace virga {

// Strict readers: the whole text is the value, numbers are finite. Each throws Error at the part that is wrong.

double parseNumber(const Argument& argument);
int64_t parseInteger(const Argument& argument);
bool parseBoolean(const Argument& argument);

/// Numbers between blanks or commas.
std::vector<double> parseNumbers(const Argument& argument);

/// Three numbers, or one that stands for all three.
std::array<double, 3> parseTriple(const Argument& argument);

/// Throws Error where a component does not fit single precision.
Vec3 toVec3(const std::array<double, 3>& triple, const Argument& argument);

/// "0.5", "0.1, 0.2, 0.3" (linear) or "#rrggbb" (the bytes of sRGB).
Rgb parseRgb(const Argument& argument);

/// One number: the same at all wavelengths. Lists of wavelengths are refused.
Rgb parseSpectrum(const Argument& argument);

}  // namespace virga
