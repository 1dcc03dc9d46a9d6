// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

#include "app/info.h"
#include "app/scene_source.h"

namespace virga::app {

int info(const SceneOptions& options) {
  if (isVolumeFile(options.file))
    printVolume(options.file);
  else if (std::filesystem::path(options.file).extension() == ".xml")
    printScene(options);
  else
    printPicture(options.file);
  return 0;
}

}  // namespace virga::app
