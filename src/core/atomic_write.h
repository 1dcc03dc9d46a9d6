// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

namespace virga {

/// Writes the file as a whole or not at all: into a temporary file in the same folder, which then takes the name. A
/// file that had the name stays untouched until then. A symbolic link is followed; a device or a pipe is written
/// directly. Throws Error, with the remedy, where the system refuses.
void writeAtomically(const std::filesystem::path& path, std::string_view bytes);

/// Throws the Error that writeAtomically() would throw now for a small file: to be called before hours of work. Leaves
/// no trace.
void checkWritable(const std::filesystem::path& path);

}  // namespace virga
