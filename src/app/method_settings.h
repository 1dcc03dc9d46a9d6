// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "methods/method.h"

namespace virga::app {

/// From `method.param=value` texts; the last one of a parameter counts. Throws Error where the method is another.
/// Whether it has such a parameter is for the method to say.
Settings methodSettings(const MethodInfo&, const std::vector<std::string>& assignments, uint64_t seed);

}  // namespace virga::app
