// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "volume/file_bytes.h"
#include "volume/volume_io.h"

namespace virga {

bool isVdb(const AlignedBytes& bytes);
std::shared_ptr<const Grid> loadVdb(const AlignedBytes& bytes, const VolumeRequest& request,
                                    const GridOptions& options);
std::vector<GridInfo> vdbInfo(const AlignedBytes& bytes);

/// Expands one Blosc buffer to exactly `size` bytes; false where it is damaged. Here because OpenVDB brings Blosc
/// along.
bool expandBlosc(const std::byte* compressed, size_t compressedSize, std::byte* out, size_t size);

}  // namespace virga
