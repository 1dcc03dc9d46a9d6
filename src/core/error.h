// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace virga {

/// Text that a SourcePosition points into. `text` may be empty (binary files): then only the name is printed.
struct SourceFile {
  std::string name;
  std::string text;
};

/// Where in a file something was said; `length` bytes from `offset`. Default: nowhere.
struct SourcePosition {
  std::shared_ptr<const SourceFile> file;
  size_t offset = 0;
  size_t length = 0;

  bool known() const { return file != nullptr; }
  int line() const;    ///< counted from 1
  int column() const;  ///< counted from 1, in bytes
};

/// Bad input: one message, where it is, and what to do about it. what() is the full text as it is shown to a user.
///
///     fog.xml:14:28: error: unknown medium type "homogenous"
///        14 |     <medium name="interior" type="homogenous">
///           |                                   ^~~~~~~~~~ did you mean "homogeneous"?
///       note: available: heterogeneous, homogeneous
class Error : public std::runtime_error {
 public:
  struct Details {
    SourcePosition position;
    std::string hint;                ///< stands behind the caret; without an excerpt, behind the message
    std::vector<std::string> notes;  ///< a line each
  };

  explicit Error(std::string message);
  Error(std::string message, Details details);

  const std::string& message() const { return message_; }
  const Details& details() const { return details_; }
  /// The same complaint, placed at `position` unless it has a place already. For errors that rise from a loader of
  /// files (which knows only its file) through the description that named the file.
  Error at(const SourcePosition& position) const;

 private:
  std::string message_;
  Details details_;
};

/// The word of `known` nearest to `word` by edit distance, or "" where none is near enough to be meant.
std::string nearest(std::string_view word, const std::vector<std::string>& known);

/// `did you mean "X"?` or "".
std::string didYouMean(std::string_view word, const std::vector<std::string>& known);

/// "a, b, c"
std::string joined(const std::vector<std::string>& words, std::string_view separator = ", ");

/// Programmer errors: active in every build, so it stays off hot paths.
[[noreturn]] void assertionFailed(const char* expression, const char* file, int line);

}  // namespace virga

#define VIRGA_ASSERT(expression) \
  ((expression) ? static_cast<void>(0) : ::virga::assertionFailed(#expression, __FILE__, __LINE__))
