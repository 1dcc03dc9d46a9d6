// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace virga::app {

/// A scene to start from: the volume, a light from the side, a ground and a camera.
struct ReadyScene {
  std::filesystem::path volume;  ///< the file to look at; of a sequence, the first
  std::filesystem::path
      nameInScene;          ///< as the scene is to name it: relative to the scene's folder, without the number
  bool isSequence = false;  ///< then the scene has a variable: -D frame=0012
};

/// As XML. Throws Error where there is nothing to see in the volume.
std::string readySceneXml(const ReadyScene&);

}  // namespace virga::app
