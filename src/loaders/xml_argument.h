// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "loaders/error_at.h"

namespace virga {

/// An attribute's value with its variables replaced, and where it stands in the file.
struct Argument {
  std::string text;
  SourcePosition position;         ///< of the text as it was written, `$variables` included
  std::vector<std::string> notes;  ///< which variables had which values
  bool verbatim = true;            ///< `text` is what the file says, byte for byte

  /// The place of a part of `text`: the part itself where text and file agree, else the whole value.
  SourcePosition part(size_t offset, size_t length) const {
    return verbatim ? SourcePosition{position.file, position.offset + offset, length} : position;
  }

  [[noreturn]] void fail(std::string message, std::string hint = "") const {
    failAt(position, std::move(message), std::move(hint));
  }
  [[noreturn]] void failAt(const SourcePosition& place, std::string message, std::string hint = "") const {
    throw errorAt(place, std::move(message), std::move(hint), notes);
  }
};

}  // namespace virga
