#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, checks the layout of the code, builds, and runs every test: all of them in the release build (whose own assertions stay on),
# then all but the slow ones (of methods, which render until statistics tell) under AddressSanitizer and UndefinedBehaviorSanitizer.
# Fails at the first step that fails; the last lines are the test runner's summary.
set -euo pipefail
cd "$(dirname "$0")/.."

jobs=$(nproc)

echo "== packages"
scripts/install-deps.sh

echo "== layout"
find src tests bench \( -name '*.h' -o -name '*.cpp' \) -print0 | xargs -0 clang-format --dry-run -Werror

echo "== release build"
scripts/build.sh release

echo "== tests of the release build"
ctest --test-dir build/release --output-on-failure --no-tests=error --parallel "$jobs"

echo "== build with sanitizers"
scripts/build.sh asan-ubsan

echo "== tests under sanitizers"
export UBSAN_OPTIONS=print_stacktrace=1
# Otherwise the search for leaks follows thread-local storage of modules by a guess at the C library's own records, and may crash there.
export ASAN_OPTIONS=intercept_tls_get_addr=0
ctest --test-dir build/asan-ubsan --output-on-failure --no-tests=error --parallel "$jobs"
