// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "core/vec.h"
#include "scene/description.h"

namespace virga {

/// A volume file that is to be looked at without a scene around it.
struct BareVolume {
  std::filesystem::path file;  ///< `.vol` is read by the volume `gridvolume`, anything else by `vdb`
  std::string grid{};          ///< name of the grid in a VDB; empty leaves the choice to the volume
  Bounds worldBounds{};        ///< of what is not zero [m]; for `.vol`, where its box is put
  float maximumDensity = 0;    ///< over all values
  double thickness = 10;       ///< optical, of the medium across the volume
  float meanDensity = 0;       ///< over the values that are not zero; 0 if unknown
};

/// A scene that shows the volume: a camera whose frame it fills, a key light from the side, a dim sky, a grey ground.
/// The medium is scaled to the thickness that is asked for. Objects have ids (`camera`, `film`, `key`, `sky`,
/// `ground`, `box`, `medium`, `density`) for edits. Throws Error where there is nothing to see.
SceneDescription describeBareVolume(const BareVolume& volume);

}  // namespace virga
