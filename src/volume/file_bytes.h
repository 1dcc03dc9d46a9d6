// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <filesystem>
#include <type_traits>

#include "core/error.h"
#include "volume/nano_tree.h"

namespace virga {

/// The file as a place for an Error.
SourcePosition inFile(const std::filesystem::path& path);

/// The whole file; Error where it cannot be read.
AlignedBytes readFile(const std::filesystem::path& path);

/// Reads little-endian values one after the other and throws Error where the bytes end.
class ByteReader {
 public:
  ByteReader(const std::byte* bytes, size_t size, size_t offset = 0) : bytes_(bytes), size_(size), offset_(offset) {
    need(0);
  }

  template <class T>
  T read() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value;
    std::memcpy(&value, take(sizeof(T)), sizeof(T));
    return value;
  }
  const std::byte* take(size_t count) {
    need(count);
    const std::byte* at = bytes_ + offset_;
    offset_ += count;
    return at;
  }
  std::string text(size_t length) {
    const std::byte* at = take(length);
    return {reinterpret_cast<const char*>(at), length};
  }
  size_t offset() const { return offset_; }
  size_t left() const { return size_ - offset_; }

 private:
  void need(size_t count) const {
    if (offset_ > size_ || count > size_ - offset_) throw Error("file is truncated or damaged");
  }

  const std::byte* bytes_;
  size_t size_, offset_;
};

}  // namespace virga
