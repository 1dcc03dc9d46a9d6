// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include "app/info.h"
#include "app/scene_source.h"
#include "core/extension.h"

namespace virga::app {
namespace {

// A scene may have any name; nothing else begins with a "<".
bool isScene(const std::string& file) {
  if (lowerCaseExtension(file) == ".xml") return true;
  std::ifstream in(file, std::ios::binary);
  char first = 0;
  return in >> first && first == '<';
}

}  // namespace

int info(const SceneOptions& options) {
  const std::string extension = lowerCaseExtension(options.file);
  if (isVolumeFile(options.file))
    printVolume(options.file);
  else if (isScene(options.file))
    printScene(options);
  else if (extension == ".obj" || extension == ".ply")
    printMesh(options.file, extension == ".obj" ? MeshFormat::obj : MeshFormat::ply);
  else
    printPicture(options.file);
  return 0;
}

}  // namespace virga::app
