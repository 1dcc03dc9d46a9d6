// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "image/image_io.h"

namespace virga::app {

enum class OutputFormat { exr, png };

/// By the extension. Throws UsageError where it is another.
OutputFormat outputFormat(const std::string& path);

/// Throws UsageError where a file is named twice, by whatever names, or its format is not known.
void checkNames(const std::vector<std::string>& images, const std::string& stats);

/// Throws UsageError where writing the output (none if empty) would destroy one of the inputs, however either is named.
void checkNotInput(const std::string& output, const std::vector<std::filesystem::path>& inputs);

/// Throws Error if one of them cannot be written: before hours of work.
void checkAllWritable(const std::vector<std::string>& images, const std::string& stats);

/// Each file is there as a whole or is left as it was.
void writePictures(const std::vector<std::string>& paths, const LayeredImage& picture);

}  // namespace virga::app
