// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>

#include "scene/scene.h"

namespace virga {

struct BuildOptions {
  std::optional<std::pair<int, int>> filmSize;  ///< in place of the film's own width and height
  bool lenient = false;                         ///< unknown and unused parameters become warnings
};

/// Validates a description and makes the scene that it describes. Objects that `previous` holds already are shared, not
/// built again. Throws Error with a position for whatever is wrong.
SceneSnapshot buildScene(const SceneDescription&, const BuildOptions& = {}, const SceneSnapshot& previous = nullptr);

}  // namespace virga
