// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "core/error.h"
#include "scene/mesh.h"

namespace virga {

// The readers of single formats. They leave normals that a vertex does not have at zero, and count no degenerate
// triangles.
TriangleMesh readObj(const std::shared_ptr<const SourceFile>& file);
TriangleMesh readPly(const std::shared_ptr<const SourceFile>& file);

/// Walks a text by tokens between blanks, and reads numbers strictly. A line ends at '\n' or '\r'.
class TextCursor {
 public:
  TextCursor(std::shared_ptr<const SourceFile> file, size_t offset)
      : file_(std::move(file)), at_(file_->text.data() + offset), end_(file_->text.data() + file_->text.size()) {}

  bool atEnd() const { return at_ == end_; }
  size_t remaining() const { return static_cast<size_t>(end_ - at_); }

  /// The next token of this line; empty at its end. A backslash before the end of a line continues it.
  std::string_view token();
  /// The next token, on whatever line.
  std::string_view tokenOnAnyLine();
  /// To the start of the next line.
  void skipLine();

  double number(std::string_view token) const;  ///< finite; throws Error at the token
  double integer(std::string_view token) const;
  float single(std::string_view token) const;  ///< a number that fits single precision

  [[noreturn]] void fail(std::string_view token, std::string message, std::string hint = "") const;

 private:
  std::shared_ptr<const SourceFile> file_;
  const char* at_;
  const char* end_;
};

}  // namespace virga
