// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <new>

#include "app/command_line.h"
#include "app/usage_error.h"
#include "core/error.h"

namespace {

constexpr int kBadInput = 1, kUsage = 2;

int fail(int code, const char* text) {
  fmt::print(stderr, "{}\n", text);
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // a file that grows too large is an error of its write, not the end of the program
  try {
    const int code = virga::app::runCommandLine(argc, argv);
    if (std::fflush(stdout) != 0) return fail(kBadInput, "error: cannot write to the standard output");
    return code;
  } catch (const virga::app::UsageError& error) {
    return fail(kUsage, (std::string("error: ") + error.what()).c_str());
  } catch (const virga::Error& error) {
    return fail(kBadInput, error.what());
  } catch (const std::bad_alloc&) {
    return fail(kBadInput, "error: out of memory");
  } catch (const std::exception& error) {
    return fail(kBadInput, (std::string("error: ") + error.what()).c_str());
  }
}
