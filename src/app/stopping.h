// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace virga::app {

/// When a render ends: at whichever of these comes first.
struct StopRules {
  std::optional<int64_t> passes{};
  std::optional<double> seconds{};  ///< of rendering: scene loading and writing do not count
  std::optional<double> relMse{};   ///< estimated, of the beauty

  bool any() const { return passes || seconds || relMse; }
};

enum class StopReason { passes, time, error, converged, interrupted };

/// "passes", "time", ...
std::string_view stopReasonName(StopReason);

/// Where a render stands after a pass.
struct RenderState {
  int64_t passes = 0;
  double seconds = 0;
  bool converged = false;
  bool interrupted = false;
  std::optional<double> relMse{};  ///< latest estimate
  int64_t relMsePasses = 0;        ///< passes that the estimate is made of
  bool hasNonFinite = false;       ///< then the estimate is of the other pixels
};

/// The latest estimate, brought to all passes: the error falls as 1 / passes, and an estimate comes now and then only.
std::optional<double> relMseNow(const RenderState&);

/// Passes before which an estimated error stops nothing: two in each of the film's 8 replicates.
inline constexpr int64_t kFewestPassesForError = 16;

/// What ends the render now, if anything. At least one pass is always rendered. `time`: a pass is not begun if it is
/// likely to end more than half its length past the limit, so a render is off by half a pass at most.
std::optional<StopReason> stopReason(const StopRules&, const RenderState&);

/// Part of the work done, in [0, 1], by the rule that is nearest to its end. The error is taken to fall as 1 / passes.
double fractionDone(const StopRules&, const RenderState&);

/// Seconds that are left; nothing as long as there is nothing to tell it from.
std::optional<double> secondsLeft(const StopRules&, const RenderState&);

/// When to estimate the error again: it costs a look at all replicates. Depends on the number of passes alone, so that
/// `--error` gives the same picture on every machine; whole rounds of the replicates, each at least a tenth further.
class ErrorSchedule {
 public:
  /// True once for each pass count at which an estimate is due.
  bool due(int64_t passes);

 private:
  int64_t next_ = 2;
};

}  // namespace virga::app
