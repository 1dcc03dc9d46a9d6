// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>

#include "app/stopping.h"
#include "methods/render_session.h"

namespace virga::app {

struct LoopOutcome {
  StopReason reason = StopReason::passes;
  RenderState state;
  bool biased = false;  ///< as the passes themselves said
};

/// Passes until a rule or `stop` ends it. The first pass is always completed, so that there is a picture; a later one
/// that `stop` meets on its way does not count. `onState` is called before the first pass and after each.
LoopOutcome renderLoop(RenderSession&, const StopRules&, std::stop_token stop,
                       const std::function<void(const RenderState&)>& onState);

}  // namespace virga::app
