// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "volume/nano_tree.h"
#include "volume/volume_io.h"

namespace virga {

/// What needs OpenVDB, which takes longer to load than `virga --help` may run: it lies in a module of its own.
struct VdbModule {
  /// `bytes` of a file are freed as soon as they are read.
  std::shared_ptr<const Grid> (*load)(AlignedBytes bytes, const VolumeRequest& request, const GridOptions& options);
  std::vector<GridInfo> (*info)(AlignedBytes bytes);     ///< likewise
  std::string (*encodeVdb)(const DenseVolume& volume);   ///< a whole `.vdb` file
  std::string (*encodeNvdb)(const DenseVolume& volume);  ///< a whole `.nvdb` file
  /// Expands one Blosc buffer to exactly `size` bytes; false where it is damaged. Here because OpenVDB brings Blosc
  /// along.
  bool (*expandBlosc)(const std::byte* compressed, size_t compressedSize, std::byte* out, size_t size);
};

/// Opens the module when it is first asked for. Throws Error where it cannot be opened.
const VdbModule& vdbModule();

bool isVdb(const AlignedBytes& bytes);

}  // namespace virga
