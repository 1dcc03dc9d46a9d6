// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"

namespace virga::xml {

struct Attribute {
  std::string name;
  std::string value;  ///< entities are decoded
  SourcePosition namePosition;
  SourcePosition valuePosition;  ///< of what is between the quotes
};

struct Element {
  std::string name;
  SourcePosition position;  ///< of the name in the start tag
  std::vector<Attribute> attributes{};
  std::vector<Element> children{};
};

/// Elements may lie this deep in each other; more is an error, so that recursion over a scene is safe.
inline constexpr int kMaxDepth = 200;

/// The text of a regular file. Throws Error (without a position) that says why it cannot be had.
std::shared_ptr<const SourceFile> readFile(const std::filesystem::path& file);

/// The root element of an XML text. Comments and processing instructions are dropped. Throws Error with a position.
Element parse(const std::shared_ptr<const SourceFile>& file);

}  // namespace virga::xml
