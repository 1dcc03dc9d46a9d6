// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "app/options.h"
#include "scene/mesh.h"

namespace virga::app {

// What `virga info` prints of each kind of file. They throw Error.

void printScene(const SceneOptions&);
void printVolume(const std::string& file);
void printPicture(const std::string& file);
void printMesh(const std::string& file, MeshFormat);

}  // namespace virga::app
