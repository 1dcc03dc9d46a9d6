// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace virga {

struct BenchScene {
  std::string name;
  std::function<SceneSnapshot()> build;
};

/// Fog in a room and a plume over ground, 640 x 480, and the scene files that an environment variable names, with
/// colons between them.
std::vector<BenchScene> benchScenes(const char* variable);

}  // namespace virga
