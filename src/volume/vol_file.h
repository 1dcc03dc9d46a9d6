// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <istream>

#include "volume/file_bytes.h"
#include "volume/volume_io.h"

namespace virga {

/// Mitsuba's grid volume: "VOL", version 3, type 1 (float32), dimensions, channels, box, values (channel, then x
/// fastest).
struct VolFile {
  int nx = 0, ny = 0, nz = 0, channels = 0;
  Bounds bounds;
  const std::byte* values = nullptr;  ///< into the bytes that were parsed; not aligned

  size_t voxels() const { return static_cast<size_t>(nx) * static_cast<size_t>(ny) * static_cast<size_t>(nz); }
};

/// Throws Error unless the box is finite and has a volume. Files with a bad one are common and load: few ask for it.
void requireSoundBox(const VolFile&);

bool isVol(const AlignedBytes& bytes);
/// Number of channels that the header of a stream speaks of; 0 if it is no `.vol`.
int volChannels(std::istream& in);
VolFile parseVol(const AlignedBytes& bytes);

std::shared_ptr<const Grid> loadVol(const AlignedBytes& bytes, const VolumeRequest& request,
                                    const GridOptions& options);
RgbGrid loadRgbVol(const AlignedBytes& bytes);
GridInfo volInfo(const AlignedBytes& bytes);

}  // namespace virga
