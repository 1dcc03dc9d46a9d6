// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/scene.h"

namespace virga {

/// A grid with nothing around its values?
bool endsByItself(const MediumView&);
/// The world's box around a box in the index coordinates of a medium's grid.
Bounds boundsInWorld(const MediumView&, const Bounds& inGrid);
/// Are all media within closed boundaries, wherever the camera is?
bool mediaAreBounded(const Scene& scene);
/// All of the scene that holds media, as far as rays from a few points tell: where grids hold nothing there are none.
/// Empty if there are no media.
Bounds boundsOfMedia(const Scene& scene);

}  // namespace virga
