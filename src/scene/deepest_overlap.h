// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "core/vec.h"

namespace virga {

/// The largest number of boxes that have a point in common, or `enough` if it is not less. Boxes are half open: those
/// that touch have no point in common.
int deepestOverlap(std::vector<Bounds> boxes, int enough);

}  // namespace virga
