// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/render_loop.h"
#include "image/image_io.h"
#include "methods/audit.h"
#include "methods/render_session.h"

namespace virga::app {

enum class WithLayers { no, yes };

/// Where the time of a render went [s].
struct Timings {
  double load = 0, build = 0, prepare = 0, render = 0, write = 0, total = 0;
  double audit = 0;
  double renderCpu = 0;  ///< user and system, of rendering alone
  double totalCpu = 0;
};

/// Everything that `--stats` tells besides what is in the session.
struct RenderReport {
  std::string sceneFile;
  uint64_t sceneHash = 0;    ///< contentHash() of its description
  std::optional<int> frame;  ///< of a sequence
  std::vector<std::string> outputs;
  std::string stats, dots;  ///< files; empty: none
  std::vector<std::string> warnings;
  LoopOutcome outcome;
  std::optional<AuditResult> audit;
  std::optional<double> relMseLimit;  ///< for the audit to judge
  Timings timings;
  int threads = 0;
};

/// The film's beauty with metadata; with layers, also all that the film holds, and the variances where there are any.
LayeredImage developed(const RenderSession&, const RenderReport&, WithLayers);

/// As JSON text.
std::string statsJson(const RenderSession&, const RenderReport&);

/// 16 hexadecimal digits.
std::string hashText(uint64_t hash);

}  // namespace virga::app
