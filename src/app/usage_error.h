// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace virga::app {

/// The command line itself is wrong: exit code 2. The text is shown as it is, behind "error: ".
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace virga::app
