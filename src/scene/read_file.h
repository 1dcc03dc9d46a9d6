// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "core/error.h"

namespace virga {

/// All bytes of a regular file. Throws Error (without a position) that says why they cannot be had.
std::shared_ptr<const SourceFile> readFile(const std::filesystem::path& file, uintmax_t maxBytes);

}  // namespace virga
