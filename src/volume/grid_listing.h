// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "volume/nano_tree.h"
#include "volume/volume_io.h"

namespace virga {

/// The names as VolumeRequest wants them: those that repeat count up, "name", "name[1]", "name[2]".
std::vector<std::string> uniqueNames(const std::vector<std::string>& names);

/// Which of the unique names is meant; Error where none is.
size_t chooseGrid(const std::vector<std::string>& names, const VolumeRequest& request);

/// Throws Error unless a grid of this kind can be a density.
void requireFog(const std::string& name, nanovdb::GridClass kind);

/// Fills in what a valid float tree of `bytes` says about itself.
void describeTree(nanovdb::FloatGrid& grid, size_t bytes, GridInfo& info);

}  // namespace virga
