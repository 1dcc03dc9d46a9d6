// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "image/image_io.h"
#include "methods/audit.h"

namespace virga::app {

/// Whether a picture's error is below a limit, as far as an audit can tell: by its whole confidence interval.
enum class Verdict { reached, notReached, undecided };

Verdict verdictOf(const AuditResult&, double relMseLimit);

/// "reached", "not reached", "undecided".
std::string_view verdictName(Verdict);

/// Two lines: bias and relMSE, each with its interval.
std::string auditText(const AuditResult&);

nlohmann::ordered_json auditJson(const AuditResult&, std::optional<double> relMseLimit);

/// As `virga.audit.bias`, `virga.audit.bias_low`, ...
void addAudit(Metadata&, const AuditResult&);

}  // namespace virga::app
