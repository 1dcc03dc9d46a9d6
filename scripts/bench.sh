#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds Virga and measures it on benchmark scenes; see bench/scenes.py --help. VIRGA_BENCH_SCENES names the folder that holds them.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install-deps.sh
scripts/build.sh release virga >&2
exec python3 bench/scenes.py "$@"
