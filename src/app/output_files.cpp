// SPDX-License-Identifier: Apache-2.0
#include "app/output_files.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "app/usage_error.h"
#include "core/atomic_write.h"
#include "core/extension.h"

namespace virga::app {
namespace {

namespace fs = std::filesystem;

// Links of both kinds lead to one file under several names; a file that is not there yet has its folder's.
bool sameFile(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error) && !error) return true;
  const fs::path ca = fs::weakly_canonical(fs::absolute(a, error), error),
                 cb = fs::weakly_canonical(fs::absolute(b, error), error);
  return !ca.empty() && ca == cb;
}

}  // namespace

OutputFormat outputFormat(const std::string& path) {
  const std::string extension = lowerCaseExtension(path);
  if (extension == ".exr") return OutputFormat::exr;
  if (extension == ".png") return OutputFormat::png;
  throw UsageError(fmt::format("\"{}\": pictures are written as .exr or .png", path));
}

void checkNames(const std::vector<std::string>& images, const std::string& stats) {
  std::vector<std::string> seen;
  if (!stats.empty()) seen.push_back(stats);
  for (const std::string& path : images) {
    outputFormat(path);
    for (const std::string& other : seen)
      if (sameFile(path, other)) throw UsageError(fmt::format("\"{}\" is named as an output twice", path));
    seen.push_back(path);
  }
}

void checkNotInput(const std::string& output, const std::vector<std::filesystem::path>& inputs) {
  if (output.empty()) return;
  for (const std::filesystem::path& input : inputs)
    if (sameFile(output, input))
      throw UsageError(fmt::format("\"{}\" is read as an input: writing it would destroy it", output));
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
