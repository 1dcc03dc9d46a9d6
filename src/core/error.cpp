// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <numeric>

namespace virga {
namespace {

struct Excerpt {
  std::string line;
  int indent;  // columns before the marked text
  int width;   // columns of the marked text
};

constexpr size_t kExcerptColumns = 100;

// The line that holds the position, cut to a readable width around it; tabs become blanks so that the caret fits.
Excerpt excerpt(const SourcePosition& position) {
  const std::string& text = position.file->text;
  const size_t offset = std::min(position.offset, text.size());
  const size_t lineStart = offset == 0 ? 0 : text.rfind('\n', offset - 1) + 1;  // npos + 1 == 0
  const size_t lineEnd = std::min(text.find('\n', offset), text.size());
  size_t start = lineStart;
  if (offset - lineStart > kExcerptColumns / 2) start = offset - kExcerptColumns / 2;
  std::string line = text.substr(start, std::min(lineEnd - start, kExcerptColumns));
  for (char& c : line)
    if (static_cast<unsigned char>(c) < 32) c = ' ';
  const size_t indent = offset - start;
  const size_t width = std::max<size_t>(1, std::min(position.length, line.size() - std::min(indent, line.size())));
  return {std::move(line), static_cast<int>(indent), static_cast<int>(width)};
}

std::string fullText(const std::string& message, const Error::Details& details) {
  const SourcePosition& position = details.position;
  std::string out;
  const bool hasExcerpt = position.known() && !position.file->text.empty();
  if (hasExcerpt) {
    out = fmt::format("{}:{}:{}: error: {}", position.file->name, position.line(), position.column(), message);
    const Excerpt e = excerpt(position);
    out += fmt::format("\n{:5} | {}\n      | {:{}}^{:~>{}}", position.line(), e.line, "", e.indent, "", e.width - 1);
    if (!details.hint.empty()) out += " " + details.hint;
  } else {
    out = position.known() ? fmt::format("{}: error: {}", position.file->name, message) : "error: " + message;
    if (!details.hint.empty()) out += "; " + details.hint;
  }
  for (const std::string& note : details.notes) out += "\n  note: " + note;
  return out;
}

size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({substituted, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

int SourcePosition::line() const {
  const std::string& text = file->text;
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(offset, text.size()));
  return 1 + static_cast<int>(std::count(text.begin(), end, '\n'));
}

int SourcePosition::column() const {
  const size_t at = std::min(offset, file->text.size());
  const size_t lineStart = at == 0 ? 0 : file->text.rfind('\n', at - 1) + 1;
  return 1 + static_cast<int>(at - lineStart);
}

Error::Error(std::string message) : Error(std::move(message), Details{}) {}

Error::Error(std::string message, Details details)
    : std::runtime_error(fullText(message, details)), message_(std::move(message)), details_(std::move(details)) {}

Error Error::at(const SourcePosition& position) const {
  if (details_.position.known() && !details_.position.file->text.empty()) return *this;
  Details placed = details_;
  std::string message = message_;
  if (details_.position.known()) message = details_.position.file->name + ": " + message;
  placed.position = position;
  return Error(std::move(message), std::move(placed));
}

std::string nearest(std::string_view word, const std::vector<std::string>& known) {
  std::string best;
  // Some letter at least must be kept: else every word of two letters is near every other.
  size_t bestDistance = std::min(std::max<size_t>(2, word.size() / 3) + 1, word.size());
  for (const std::string& candidate : known) {
    const size_t d = editDistance(word, candidate);
    if (d < bestDistance) bestDistance = d, best = candidate;
  }
  return best;
}

std::string didYouMean(std::string_view word, const std::vector<std::string>& known) {
  const std::string best = nearest(word, known);
  return best.empty() ? "" : fmt::format("did you mean \"{}\"?", best);
}

std::string joined(const std::vector<std::string>& words, std::string_view separator) {
  return fmt::format("{}", fmt::join(words, separator));
}

void assertionFailed(const char* expression, const char* file, int line) {
  std::fprintf(stderr, "%s:%d: assertion failed: %s\n", file, line, expression);
  std::abort();
}

}  // namespace virga
