// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "scene/scene.h"

namespace virga {

/// A grid with nothing around its values?
bool endsByItself(const MediumView&);
/// The world's box around a box in the index coordinates of a medium's grid.
Bounds boundsInWorld(const MediumView&, const Bounds& inGrid);
/// Boxes that hold all of a medium: those of the shapes that it fills, cut with that of its grid's filled cells if it
/// is nothing elsewhere. Where neither ends, as far as may matter. None if the medium is nowhere.
std::vector<Bounds> placesOf(const Scene& scene, int medium);
/// A box that holds all media, likewise: nothing is missed, though there may be less in it. Empty if there are none.
Bounds boundsOfMedia(const Scene& scene);
/// Boxes without common points that hold all media, `most` at most (> 0): media that are wider than the gap between
/// them share one.
std::vector<Bounds> boxesOfMedia(const Scene& scene, size_t most);

}  // namespace virga
