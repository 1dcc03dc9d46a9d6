// SPDX-License-Identifier: Apache-2.0
#include "app/output_files.h"

#include <fmt/format.h>

#include <filesystem>
#include <set>

#include "app/usage_error.h"
#include "core/atomic_write.h"

namespace virga::app {

OutputFormat outputFormat(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".exr") return OutputFormat::exr;
  if (extension == ".png") return OutputFormat::png;
  throw UsageError(fmt::format("\"{}\": pictures are written as .exr or .png", path));
}

void checkNames(const std::vector<std::string>& images, const std::string& stats) {
  std::set<std::filesystem::path> seen;
  if (!stats.empty()) seen.insert(std::filesystem::path(stats).lexically_normal());
  for (const std::string& path : images) {
    outputFormat(path);
    if (!seen.insert(std::filesystem::path(path).lexically_normal()).second)
      throw UsageError(fmt::format("\"{}\" is named as an output twice", path));
  }
}

void checkAllWritable(const std::vector<std::string>& images, const std::string& stats) {
  for (const std::string& path : images) checkWritable(path);
  if (!stats.empty()) checkWritable(stats);
}

void writePictures(const std::vector<std::string>& paths, const LayeredImage& picture) {
  for (const std::string& path : paths) {
    if (outputFormat(path) == OutputFormat::exr)
      writeExr(path, picture);
    else
      writePng(path, picture.beauty);
  }
}

}  // namespace virga::app
