// SPDX-License-Identifier: Apache-2.0
#include "app/frames.h"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>

namespace virga::app {
namespace {

std::optional<int> frameNumber(std::string_view text) {
  constexpr int kLast = 999'999;
  int number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool valid = code == std::errc() && end == text.data() + text.size() && number >= 0 && number <= kLast;
  return valid ? std::optional(number) : std::nullopt;
}

}  // namespace

std::optional<FrameRange> frameRange(std::string_view text) {
  const size_t dots = text.find("..");
  const auto first = frameNumber(text.substr(0, dots));
  const auto last = dots == std::string_view::npos ? first : frameNumber(text.substr(dots + 2));
  if (!first || !last || *last < *first) return std::nullopt;
  return FrameRange{*first, *last};
}

std::string frameText(int frame) { return fmt::format("{:04}", frame); }

std::string numberedFile(const std::string& path, int frame) {
  std::filesystem::path file(path);
  return file.replace_extension(fmt::format(".{:04}{}", frame, file.extension().string())).string();
}

std::string fileOfFrame(const std::string& path, int frame) {
  if (path.empty()) return path;
  const std::filesystem::path file(path);
  std::string name = file.filename().string();
  const size_t begin = name.find('#');
  if (begin == std::string::npos) return numberedFile(path, frame);
  const size_t end = std::min(name.find_first_not_of('#', begin), name.size());
  name.replace(begin, end - begin, fmt::format("{:0{}}", frame, end - begin));
  return (file.parent_path() / name).string();
}

}  // namespace virga::app
