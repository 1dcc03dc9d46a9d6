// SPDX-License-Identifier: Apache-2.0
#include "app/audit_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace virga::app {
namespace {

nlohmann::ordered_json estimatedJson(const Estimated& e) {
  return {{"value", e.value}, {"low", e.low}, {"high", e.high}};
}

void addEstimated(Metadata& m, const std::string& name, const Estimated& e) {
  m["virga.audit." + name] = e.value;
  m["virga.audit." + name + "_low"] = e.low;
  m["virga.audit." + name + "_high"] = e.high;
}

}  // namespace

Verdict verdictOf(const AuditResult& audit, double relMseLimit) {
  if (audit.relMse.high <= relMseLimit) return Verdict::reached;
  return audit.relMse.low > relMseLimit ? Verdict::notReached : Verdict::undecided;
}

std::string_view verdictName(Verdict verdict) {
  constexpr std::string_view kNames[] = {"reached", "not reached", "undecided"};
  return kNames[static_cast<int>(verdict)];
}

std::string auditText(const AuditResult& a) {
  return fmt::format(
      "audit: bias   {:+.4g} %  (95 %: {:+.4g} % to {:+.4g} %)\n"
      "audit: relMSE {:.4g}  (95 %: {:.4g} to {:.4g}; {} pixels, {} samples in each, {:.3g} s)\n",
      100 * a.bias.value, 100 * a.bias.low, 100 * a.bias.high, a.relMse.value, a.relMse.low, a.relMse.high, a.pixels,
      a.samples, a.seconds);
}

nlohmann::ordered_json auditJson(const AuditResult& a, std::optional<double> relMseLimit) {
  nlohmann::ordered_json json = {{"bias", estimatedJson(a.bias)},
                                 {"relmse", estimatedJson(a.relMse)},
                                 {"correction", a.correction},
                                 {"too_short", a.tooShort()},
                                 {"pixels", a.pixels},
                                 {"samples", a.samples},
                                 {"non_finite", a.nonFinite},
                                 {"seconds", a.seconds}};
  if (relMseLimit) json["error"] = {{"limit", *relMseLimit}, {"verdict", verdictName(verdictOf(a, *relMseLimit))}};
  return json;
}

void addAudit(Metadata& m, const AuditResult& a) {
  addEstimated(m, "bias", a.bias);
  addEstimated(m, "relmse", a.relMse);
  m["virga.audit.pixels"] = a.pixels;
  m["virga.audit.samples"] = a.samples;
  m["virga.audit.seconds"] = a.seconds;
}

}  // namespace virga::app
