// SPDX-License-Identifier: Apache-2.0
#include "scene/read_file.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>

namespace virga {
namespace {

namespace fs = std::filesystem;

Error cannotRead(const fs::path& file, std::string_view why) {
  return Error(fmt::format("cannot read \"{}\": {}", file.string(), why));
}

}  // namespace

std::shared_ptr<const SourceFile> readFile(const fs::path& file, uintmax_t maxBytes) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (status.type() == fs::file_type::not_found) throw cannotRead(file, "no such file");
  if (error) throw cannotRead(file, error.message());
  if (fs::is_directory(status)) throw cannotRead(file, "this is a folder, not a file");
  if (!fs::is_regular_file(status)) throw cannotRead(file, "this is not a regular file");
  const uintmax_t size = fs::file_size(file, error);
  if (error) throw cannotRead(file, error.message());
  if (size > maxBytes) throw cannotRead(file, fmt::format("{} bytes, the limit is {}", size, maxBytes));

  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw cannotRead(file, std::strerror(errno));
  std::string text(static_cast<size_t>(size), '\0');
  if (!stream.read(text.data(), static_cast<std::streamsize>(size)))
    throw cannotRead(file, "it ended before its size was reached");
  return std::make_shared<const SourceFile>(SourceFile{file.string(), std::move(text)});
}

}  // namespace virga
