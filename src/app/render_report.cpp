// SPDX-License-Identifier: Apache-2.0
#include "app/render_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "app/audit_report.h"
#include "app/stopwatch.h"

namespace virga::app {
namespace {

using Json = nlohmann::ordered_json;

// A method may turn out biased by a setting that its registry row knows nothing of.
std::string_view biasClass(const RenderSession& session, const LoopOutcome& outcome) {
  const Accuracy accuracy = session.info().accuracy;
  return accuracyName(outcome.biased && accuracy == Accuracy::unbiased ? Accuracy::biased : accuracy);
}

Metadata metadata(const RenderSession& session, const RenderReport& report) {
  Metadata m;
  m["virga.version"] = VIRGA_VERSION;
  m["virga.scene"] = report.sceneFile;
  if (report.frame) m["virga.frame"] = int64_t{*report.frame};
  m["virga.scene_hash"] = hashText(report.sceneHash);
  m["virga.method"] = std::string(session.info().name);
  for (const auto& [name, value] : session.method().settingsInForce())
    m[fmt::format("virga.{}.{}", session.info().name, name)] = value;
  m["virga.seed"] = std::to_string(session.settings().seed);
  m["virga.passes"] = session.film().passes();
  m["virga.seconds"] = report.outcome.state.seconds;
  m["virga.bias"] = std::string(biasClass(session, report.outcome));
  m["virga.non_finite_samples"] = static_cast<int64_t>(session.film().nonFiniteSamples());
  m["virga.replicates"] = int64_t{Film::kReplicates};
  if (const auto error = session.film().estimatedRelMse()) m["virga.estimated_relmse"] = *error;
  if (report.audit) addAudit(m, *report.audit);
  return m;
}

void addLayers(const Film& film, LayeredImage& picture) {
  for (int i = 0; i < kLayerCount; ++i) {
    const Layer layer = static_cast<Layer>(i);
    if (!film.layers().has(layer)) continue;
    const std::string name(kLayerNames[static_cast<size_t>(i)]);
    picture.layers.emplace_back(name, film.layer(layer));
    if (film.hasVariance()) picture.layerVariances.emplace_back(name, film.layerVariance(layer));
  }
  if (film.hasVariance()) picture.variance = film.beautyVariance();
}

Json timingsJson(const Timings& t) {
  return {{"load", t.load},   {"build", t.build}, {"prepare", t.prepare},      {"render", t.render},
          {"audit", t.audit}, {"write", t.write}, {"render_cpu", t.renderCpu}, {"total_cpu", t.totalCpu},
          {"total", t.total}};
}

Json sceneJson(const RenderSession& session, const RenderReport& report) {
  return {{"file", report.sceneFile},
          {"hash", hashText(report.sceneHash)},
          {"width", session.film().width()},
          {"height", session.film().height()}};
}

Json methodJson(const RenderSession& session, const LoopOutcome& outcome) {
  return {{"name", session.info().name},
          {"bias", biasClass(session, outcome)},
          {"settings", session.method().settingsInForce()},
          {"seed", session.settings().seed}};
}

double samplesPerSecond(const RenderSession& session, const RenderState& state) {
  const double pixels = static_cast<double>(session.film().width()) * session.film().height();
  return state.seconds > 0 ? pixels * static_cast<double>(state.passes) / state.seconds : 0;
}

}  // namespace

std::string hashText(uint64_t hash) { return fmt::format("{:016x}", hash); }

LayeredImage developed(const RenderSession& session, const RenderReport& report, WithLayers withLayers) {
  LayeredImage picture;
  picture.beauty = session.film().beauty();
  if (withLayers == WithLayers::yes) addLayers(session.film(), picture);
  picture.metadata = metadata(session, report);
  return picture;
}

std::string statsJson(const RenderSession& session, const RenderReport& report) {
  const auto error = session.film().estimatedRelMse();
  const Json json = {{"version", VIRGA_VERSION},
                     {"scene", sceneJson(session, report)},
                     {"frame", report.frame ? Json(*report.frame) : Json(nullptr)},
                     {"method", methodJson(session, report.outcome)},
                     {"threads", report.threads},
                     {"passes", session.film().passes()},
                     {"stopped_by", stopReasonName(report.outcome.reason)},
                     {"seconds", timingsJson(report.timings)},
                     {"samples_per_second", samplesPerSecond(session, report.outcome.state)},
                     {"estimated_relmse", error ? Json(*error) : Json(nullptr)},
                     {"audit", report.audit ? auditJson(*report.audit, report.relMseLimit) : Json(nullptr)},
                     {"non_finite_samples", session.film().nonFiniteSamples()},
                     {"resident_bytes", residentBytes()},
                     {"peak_resident_bytes", peakResidentBytes()},
                     {"warnings", report.warnings},
                     {"outputs", report.outputs}};
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace virga::app
