// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/error.h"

namespace virga {

inline Error errorAt(const SourcePosition& position, std::string message, std::string hint = {},
                     std::vector<std::string> notes = {}) {
  return Error(std::move(message), {.position = position, .hint = std::move(hint), .notes = std::move(notes)});
}

}  // namespace virga
