// SPDX-License-Identifier: Apache-2.0
#include "app/audit_report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace virga::app {
namespace {

AuditResult audit(double low, double high) {
  AuditResult a;
  a.bias = {-0.012, -0.02, -0.004};
  a.relMse = {(low + high) / 2, low, high};
  a.pixels = 1024;
  a.samples = 400;
  return a;
}

TEST(AuditReport, TheWholeIntervalDecides) {
  EXPECT_EQ(verdictOf(audit(1e-4, 9e-4), 1e-3), Verdict::reached);
  EXPECT_EQ(verdictOf(audit(2e-3, 3e-3), 1e-3), Verdict::notReached);
  EXPECT_EQ(verdictOf(audit(5e-4, 2e-3), 1e-3), Verdict::undecided);
  EXPECT_EQ(verdictOf(audit(-5e-4, 5e-4), 1e-3), Verdict::reached);
}

TEST(AuditReport, TellsBothWithTheirIntervals) {
  EXPECT_EQ(auditText(audit(1e-3, 3e-3)),
            "audit: bias   -1.2 %  (95 %: -2 % to -0.4 %)\n"
            "audit: relMSE 0.002  (95 %: 0.001 to 0.003; 1024 pixels, 400 samples in each, 0 s)\n");
}

TEST(AuditReport, JsonHasTheVerdictOnlyWhereAnErrorWasAskedFor) {
  EXPECT_EQ(auditJson(audit(1e-4, 9e-4), 1e-3)["error"]["verdict"], "reached");
  EXPECT_FALSE(auditJson(audit(1e-4, 9e-4), std::nullopt).contains("error"));
}

}  // namespace
}  // namespace virga::app
