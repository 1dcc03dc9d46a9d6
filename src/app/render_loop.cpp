// SPDX-License-Identifier: Apache-2.0
#include "app/render_loop.h"

#include "app/stopwatch.h"
#include "core/error.h"

namespace virga::app {
namespace {

// A render that waits for an estimate which never comes would not end.
void requireEstimate(const RenderSession& session, const StopRules& rules, const RenderState& state) {
  if (!rules.relMse || rules.passes || rules.seconds) return;
  if (state.passes < kFewestPassesForError || state.relMse) return;
  throw Error(
      "--error: method \"" + std::string(session.info().name) + "\" gives no estimate of its error for this scene",
      {.position = {}, .hint = "use --passes or --time", .notes = {}});
}

void estimate(const RenderSession& session, RenderState& state) {
  state.relMse = session.film().estimatedRelMse();
  state.relMsePasses = state.passes;
}

}  // namespace

LoopOutcome renderLoop(RenderSession& session, const StopRules& rules, std::stop_token stop,
                       const std::function<void(const RenderState&)>& onState) {
  const Stopwatch watch;
  LoopOutcome out;
  RenderState& state = out.state;
  ErrorSchedule schedule;
  onState(state);
  while (true) {
    const PassResult pass = session.step({}, state.passes == 0 ? std::stop_token{} : stop);
    state.passes = session.film().passes();
    state.converged = pass.converged;
    state.hasNonFinite = session.film().nonFiniteSamples() > 0;
    state.interrupted = stop.stop_requested();
    out.biased |= pass.biased;
    if (schedule.due(state.passes)) estimate(session, state);
    state.seconds = watch.seconds();
    onState(state);
    requireEstimate(session, rules, state);
    if (const auto reason = stopReason(rules, state)) {
      out.reason = *reason;
      estimate(session, state);
      return out;
    }
  }
}

}  // namespace virga::app
