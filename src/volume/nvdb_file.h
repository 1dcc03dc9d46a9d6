// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "volume/file_bytes.h"
#include "volume/volume_io.h"

namespace virga {

bool isNvdb(const AlignedBytes& bytes);
std::shared_ptr<const Grid> loadNvdb(AlignedBytes bytes, const VolumeRequest& request, const GridOptions& options);
std::vector<GridInfo> nvdbInfo(const AlignedBytes& bytes);

}  // namespace virga
