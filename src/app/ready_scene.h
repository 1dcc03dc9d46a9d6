// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace virga::app {

/// A scene to start from: the volume, a light from the side, a ground and a camera.
struct ReadyScene {
  std::vector<std::string> frames;  ///< the volume's file, or those of a sequence: all of them must fit the picture
  /// As the scene is to name it: relative to the scene's folder, without the number.
  std::filesystem::path nameInScene;
  double thickness = 10;    ///< optical, across the volume
  bool isSequence = false;  ///< then the scene has a variable: -D frame=0012
};

/// As XML. Throws Error where there is nothing to see in the volume.
std::string readySceneXml(const ReadyScene&);

}  // namespace virga::app
