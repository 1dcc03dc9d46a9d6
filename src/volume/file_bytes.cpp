// SPDX-License-Identifier: Apache-2.0
#include "volume/file_bytes.h"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <system_error>

namespace virga {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void fail(const fs::path& path, const std::string& what, int code) {
  throw Error(fmt::format("{}: {}", what, std::generic_category().message(code)), {inFile(path), "", {}});
}

}  // namespace

SourcePosition inFile(const fs::path& path) {
  return {std::make_shared<const SourceFile>(SourceFile{path.string(), ""}), 0, 0};
}

AlignedBytes readFile(const fs::path& path) {
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (!fs::exists(status)) fail(path, "cannot open the file", code ? code.value() : ENOENT);
  if (!fs::is_regular_file(status)) throw Error("is not a file", {inFile(path), "", {}});
  const auto size = static_cast<size_t>(fs::file_size(path, code));
  if (code) fail(path, "cannot open the file", code.value());
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(path, "cannot open the file", errno);
  AlignedBytes bytes(size);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!in) fail(path, "cannot read the file", EIO);
  return bytes;
}

}  // namespace virga
