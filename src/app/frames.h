// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace virga::app {

/// Frames of a sequence, both ends included.
struct FrameRange {
  int first = 1, last = 1;

  int count() const { return last - first + 1; }
};

/// "3..24", or "7" for one alone. Nothing where the text is neither, or the range is empty or leaves 0 to 999999.
std::optional<FrameRange> frameRange(std::string_view text);

/// As files of sequences are numbered, and as `$frame` stands in a scene: "0012".
std::string frameText(int frame);

/// "smoke.0012.vdb" of "smoke.vdb".
std::string numberedFile(const std::string& path, int frame);

/// The picture of one frame: "#" in the last part of the path become the number, as many digits as there are "#";
/// without any, as numberedFile. Of an empty path, an empty one.
std::string fileOfFrame(const std::string& path, int frame);

}  // namespace virga::app
