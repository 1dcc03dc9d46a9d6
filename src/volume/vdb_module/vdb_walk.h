// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "volume/file_bytes.h"

namespace virga {

/// How a tree's values lie in a VDB file.
struct VdbEncoding {
  enum Compression : uint32_t { zip = 1, activeMask = 2, blosc = 4 };

  size_t valueSize = sizeof(float);   ///< of single values [bytes]
  size_t storedSize = sizeof(float);  ///< of values in arrays; 2 where they are halves [bytes]
  uint32_t compression = 0;           ///< flags of the grid
};

/// Walks a tree of a VDB file (root, 32^3, 16^3, 8^3; file version 222 and later) from `offset` on and throws Error
/// unless all its counts and lengths fit. OpenVDB reads past its buffers where they do not.
void requireSoundTree(const AlignedBytes& file, size_t offset, const VdbEncoding& encoding);

/// Throws Error unless a Blosc buffer says that it is as long as it is. Blosc believes what it says.
void requireWholeBlosc(const std::byte* chunk, size_t size);

}  // namespace virga
