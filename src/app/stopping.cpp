// SPDX-License-Identifier: Apache-2.0
#include "app/stopping.h"

#include <algorithm>

#include "image/film.h"

namespace virga::app {
namespace {

double secondsPerPass(const RenderState& state) { return state.seconds / static_cast<double>(state.passes); }

bool timeIsUp(double limit, const RenderState& state) { return state.seconds + secondsPerPass(state) / 2 > limit; }

bool errorIsReached(double limit, const RenderState& state) {
  return state.relMse && state.relMsePasses >= kFewestPassesForError && *state.relMse <= limit;
}

// Passes after which the error will have fallen to `limit`, if it falls as 1 / passes.
std::optional<double> passesToError(double limit, const RenderState& state) {
  if (!state.relMse) return std::nullopt;
  const double passes = static_cast<double>(state.relMsePasses) * *state.relMse / limit;
  return std::max(passes, static_cast<double>(kFewestPassesForError));
}

}  // namespace

std::optional<double> relMseNow(const RenderState& state) {
  if (!state.relMse || state.passes == 0) return state.relMse;
  return *state.relMse * static_cast<double>(state.relMsePasses) / static_cast<double>(state.passes);
}

std::string_view stopReasonName(StopReason reason) {
  switch (reason) {
    case StopReason::passes:
      return "passes";
    case StopReason::time:
      return "time";
    case StopReason::error:
      return "error";
    case StopReason::converged:
      return "converged";
    case StopReason::interrupted:
      return "interrupted";
  }
  return "";
}

std::optional<StopReason> stopReason(const StopRules& rules, const RenderState& state) {
  if (state.passes == 0) return std::nullopt;
  if (state.interrupted) return StopReason::interrupted;
  if (state.converged) return StopReason::converged;
  if (rules.passes && state.passes >= *rules.passes) return StopReason::passes;
  if (rules.relMse && errorIsReached(*rules.relMse, state)) return StopReason::error;
  if (rules.seconds && timeIsUp(*rules.seconds, state)) return StopReason::time;
  return std::nullopt;
}

double fractionDone(const StopRules& rules, const RenderState& state) {
  const double passes = static_cast<double>(state.passes);
  double done = 0;
  if (rules.passes) done = std::max(done, passes / static_cast<double>(*rules.passes));
  if (rules.seconds) done = std::max(done, state.seconds / *rules.seconds);
  if (rules.relMse)
    if (const auto needed = passesToError(*rules.relMse, state)) done = std::max(done, passes / *needed);
  return std::min(done, 1.0);
}

std::optional<double> secondsLeft(const StopRules& rules, const RenderState& state) {
  std::optional<double> left;
  const auto shorten = [&left](double seconds) { left = std::max(0.0, std::min(left.value_or(seconds), seconds)); };
  if (rules.seconds) shorten(*rules.seconds - state.seconds);
  if (state.passes == 0) return left;
  const double passes = static_cast<double>(state.passes);
  if (rules.passes) shorten((static_cast<double>(*rules.passes) - passes) * secondsPerPass(state));
  if (rules.relMse)
    if (const auto needed = passesToError(*rules.relMse, state)) shorten((*needed - passes) * secondsPerPass(state));
  return left;
}

bool ErrorSchedule::due(int64_t passes) {
  if (passes < next_) return false;
  constexpr int64_t kRound = Film::kReplicates;
  if (passes < kRound) {
    next_ = 2 * passes;
  } else {
    const int64_t rounds = passes / kRound;
    next_ = kRound * (rounds + std::max<int64_t>(1, rounds / 10));
  }
  return true;
}

}  // namespace virga::app
