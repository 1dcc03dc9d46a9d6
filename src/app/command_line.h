// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace virga::app {

/// Parses the command line, runs the command and returns the exit code. Throws UsageError for a line that makes no
/// sense and whatever the command throws.
int runCommandLine(int argc, char** argv);

}  // namespace virga::app
