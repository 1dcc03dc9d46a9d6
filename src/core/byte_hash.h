// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <string_view>

#include "core/random.h"

namespace virga {

/// 64-bit hash of a string of bytes that comes in pieces; each but the last has a length that is a multiple of 8.
class ByteHash {
 public:
  void add(std::string_view bytes) {
    length_ += bytes.size();
    for (; bytes.size() >= 8; bytes.remove_prefix(8)) mix(bytes.substr(0, 8));
    if (!bytes.empty()) mix(bytes);
  }
  uint64_t value() const { return hash64(state_ ^ length_); }

 private:
  void mix(std::string_view upTo8) {
    uint64_t word = 0;
    std::memcpy(&word, upTo8.data(), upTo8.size());
    state_ = hash64(state_ ^ word);
  }

  uint64_t state_ = 0, length_ = 0;
};

}  // namespace virga
