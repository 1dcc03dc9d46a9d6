// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "app/options.h"
#include "scene/description.h"

namespace virga::app {

/// A scene file, or a bare volume in a ready scene. Warnings are full texts. Throws Error.
SceneDescription loadScene(const SceneOptions&, std::vector<std::string>& warnings);

/// A ready scene around a volume, or around all frames of a sequence (it names the first): of several grids, "density"
/// or the first that can be loaded. `thickness` is the optical one, across the volume. Throws Error where there is
/// none.
SceneDescription sceneAroundVolume(const std::vector<std::string>& frames, double thickness);

/// A volume by what it holds, or by its name: ".vdb", ".nvdb" or ".vol".
bool isVolumeFile(const std::string& path);

}  // namespace virga::app
