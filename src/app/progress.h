// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "app/stopping.h"

namespace virga::app {

/// "0.42 s", "12 s", "3 min 20 s", "2 h 05 min"
std::string durationText(double seconds);
/// "512 B", "8.4 MB", "1.20 GB" (powers of 1000)
std::string bytesText(double bytes);
/// "64 passes, 3.2 s, error 1.2e-03, 5 s left"
std::string progressText(const StopRules&, const RenderState&);
/// "[######----------]"
std::string barText(double fraction, int width);

/// Tells on stderr how far a render is: a bar that redraws itself on a terminal, now and then a line elsewhere.
class Progress {
 public:
  enum class Mode { silent, lines, bar };
  /// The bar on a terminal, lines elsewhere.
  static Mode automatic();

  Progress(Mode mode, const StopRules& rules) : mode_(mode), rules_(rules) {}
  void show(const RenderState&);
  /// The last word on it, on a line that stays.
  void finish(const RenderState&);

 private:
  void draw(const RenderState&);
  bool due(double seconds) const;

  Mode mode_;
  StopRules rules_;
  std::optional<double> shownAt_;  ///< [s] of rendering
};

}  // namespace virga::app
