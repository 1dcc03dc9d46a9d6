// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/transform.h"
#include "volume/dense_volume.h"
#include "volume/grid.h"

namespace virga {

// Formats are told apart by content. Whatever is wrong with a file - missing, truncated, damaged, not a volume - is an
// Error that names it.

enum class VolumeFormat { none, vol, vdb, nvdb };

/// By the file's first bytes; where those say nothing (or cannot be read), by its extension, in upper or lower case.
VolumeFormat volumeFormat(const std::filesystem::path& path);

struct VolumeRequest {
  std::string grid;  ///< "": the only one, or "density"; "density[1]": the second of that name
};

/// A scalar grid of a `.vol`, `.vdb` (float, half, double) or `.nvdb` (float; codecs none, zip, blosc). Level sets,
/// vectors and perspective transforms are refused.
std::shared_ptr<const Grid> loadVolume(const std::filesystem::path& path, const VolumeRequest& request = {},
                                       const GridOptions& options = {});

/// A `.vol` of three channels, or of one, which becomes grey.
RgbGrid loadRgbVolume(const std::filesystem::path& path);

/// A `.vol` of three channels. False for all else, also for what cannot be read.
bool holdsColors(const std::filesystem::path& path);

/// The box that a `.vol` says it covers; what Mitsuba's `use_grid_bbox` asks for. A box without
/// volume, and other formats: an Error.
Bounds volBounds(const std::filesystem::path& path);

struct GridInfo {
  std::string name;       ///< as VolumeRequest wants it
  std::string kind;       ///< "fog volume", "level set", "staggered", "unknown"
  std::string valueType;  ///< "float", "half", "double", "vec3s", ...
  std::string format;     ///< "vol 3", "vdb 224", "nvdb 32.3.3, zip"
  std::string problem;    ///< why loadVolume refuses it; "" if it does not
  uint64_t activeVoxels = 0;
  std::array<int64_t, 3> indexLo{}, indexHi{};  ///< box of the active voxels, inclusive
  Bounds worldBounds;                           ///< of that box, voxels counted whole
  bool valuesKnown = false;                     ///< false where values are no scalars or are not finite
  float minimum = 0, maximum = 0, mean = 0;     ///< over active voxels, where known
  size_t bytes = 0;                             ///< of the values or of the tree, in memory
  Matrix4 indexToWorld;
};

/// All grids of a file, in its order, also those that cannot be loaded.
std::vector<GridInfo> listGrids(const std::filesystem::path& path);

// Writers replace the file at once or leave it as it was. They throw Error where it cannot be written.

/// One channel; the box must be axis-aligned in world space, because the format has no rotation.
void writeVol(const std::filesystem::path& path, const DenseVolume& volume);
/// A fog volume; zeros become inactive.
void writeVdb(const std::filesystem::path& path, const DenseVolume& volume);
void writeNvdb(const std::filesystem::path& path, const DenseVolume& volume);

}  // namespace virga
