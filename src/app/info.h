// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "app/options.h"

namespace virga::app {

// What `virga info` prints of each kind of file. They throw Error.

void printScene(const SceneOptions&);
void printVolume(const std::string& file);
void printPicture(const std::string& file);

}  // namespace virga::app
