// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <istream>
#include <streambuf>

namespace virga {

/// Bytes as the buffer of a stream. They are not copied: they outlive it.
class MemoryBuffer : public std::streambuf {
 public:
  MemoryBuffer(const std::byte* bytes, size_t size) {
    char* begin = const_cast<char*>(reinterpret_cast<const char*>(bytes));  // streambuf wants it so; nothing writes
    setg(begin, begin, begin + size);
  }

 private:
  pos_type seekoff(off_type offset, std::ios::seekdir from, std::ios::openmode) override {
    const off_type base = from == std::ios::beg ? 0 : from == std::ios::cur ? gptr() - eback() : egptr() - eback();
    if (offset < -base || offset > egptr() - eback() - base) return pos_type(off_type(-1));
    setg(eback(), eback() + base + offset, egptr());
    return base + offset;
  }
  pos_type seekpos(pos_type position, std::ios::openmode which) override {
    return seekoff(off_type(position), std::ios::beg, which);
  }
};

/// Bytes as a stream that throws std::ios_base::failure where they end. OpenVDB itself does not look whether a read
/// succeeded: on a plain stream it would go on with what its variables held. (What it had allocated for a tree's
/// topology is lost then.)
class MemoryStream : private MemoryBuffer, public std::istream {
 public:
  MemoryStream(const std::byte* bytes, size_t size)
      : MemoryBuffer(bytes, size), std::istream(static_cast<MemoryBuffer*>(this)) {
    exceptions(std::ios::failbit | std::ios::badbit);
  }
};

}  // namespace virga
