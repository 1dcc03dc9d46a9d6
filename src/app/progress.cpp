// SPDX-License-Identifier: Apache-2.0
#include "app/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace virga::app {
namespace {

constexpr int kBarWidth = 24;
constexpr double kRedraw = 0.1;       // [s] between two drawings of the bar
constexpr double kFirstLine = 2;      // [s] before the first plain line
constexpr double kLongestPause = 60;  // [s] between two plain lines

}  // namespace

std::string durationText(double seconds) {
  constexpr double kDay = 86400;
  if (seconds >= 3652.5 * kDay) return "more than 10 years";
  if (seconds >= 2 * kDay) return fmt::format("{:.0f} days", seconds / kDay);
  if (seconds < 9.95) return fmt::format("{:.{}f} s", seconds, seconds < 0.995 ? 2 : 1);
  const int64_t whole = std::llround(seconds);
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

std::string bytesText(double bytes) {
  if (bytes < 1000) return fmt::format("{:.0f} B", bytes);
  constexpr const char* kUnits[] = {"kB", "MB", "GB", "TB"};
  int unit = -1;
  while (bytes >= 999.5 && unit < 3) bytes /= 1000, ++unit;
  return fmt::format("{:.3g} {}", bytes, kUnits[unit]);
}

std::string progressText(const StopRules& rules, const RenderState& state) {
  std::string text = rules.passes ? fmt::format("{}/{} passes", state.passes, *rules.passes)
                                  : fmt::format("{} pass{}", state.passes, state.passes == 1 ? "" : "es");
  text += ", " + durationText(state.seconds);
  if (const auto error = relMseNow(state))
    text += fmt::format(", error {:.1e}{}", *error, state.hasNonFinite ? " of the finite pixels" : "");
  if (const auto left = secondsLeft(rules, state)) text += fmt::format(", {} left", durationText(*left));
  return text;
}

std::string barText(double fraction, int width) {
  const int full = static_cast<int>(std::lround(fraction * width));
  return fmt::format("[{:#>{}}{:->{}}]", "", full, "", width - full);
}

Progress::Mode Progress::automatic() { return ::isatty(STDERR_FILENO) ? Mode::bar : Mode::lines; }

// Plain lines come ever more rarely, so that the log of a long render stays short.
bool Progress::due(double seconds) const {
  if (mode_ == Mode::bar) return !shownAt_ || seconds - *shownAt_ >= kRedraw;
  if (!shownAt_) return seconds >= kFirstLine;
  return seconds - *shownAt_ >= std::min(*shownAt_, kLongestPause);
}

void Progress::draw(const RenderState& state) {
  const std::string text = progressText(rules_, state);
  if (mode_ == Mode::bar) {
    fmt::print(stderr, "\r\033[K{} {}", barText(fractionDone(rules_, state), kBarWidth), text);
    std::fflush(stderr);
  } else {
    fmt::print(stderr, "{}\n", text);
  }
  shownAt_ = state.seconds;
}

void Progress::show(const RenderState& state) {
  if (mode_ != Mode::silent && due(state.seconds)) draw(state);
}

void Progress::finish(const RenderState& state) {
  if (mode_ == Mode::silent) return;
  const std::string text = progressText({}, state);
  if (mode_ == Mode::bar)
    fmt::print(stderr, "\r\033[K{} {}\n", barText(1, kBarWidth), text);
  else
    fmt::print(stderr, "{}\n", text);
}

}  // namespace virga::app
