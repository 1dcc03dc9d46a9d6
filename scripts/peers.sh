#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds Virga and holds it against Mitsuba 3 on the scenes of bench/peers (docs/results/peers.md is written anew), and, where
# VIRGA_ASSETS is set, against the references of Mitsuba's own tests of participating media. Takes some minutes. Options go to
# bench/peers.py; see its --help.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install-deps.sh
scripts/build.sh release virga >&2
if ! python3 -c "import mitsuba" 2>/dev/null; then
  echo "error: python3 finds no mitsuba; pip install mitsuba" >&2
  exit 1
fi

result=0
python3 bench/peers.py --document "$@" || result=$?
if [[ -n "${VIRGA_ASSETS:-}" ]]; then
  python3 bench/mitsuba_media_tests.py || result=$?
else
  echo "VIRGA_ASSETS is not set: Mitsuba's own tests are left out" >&2
fi
exit "$result"
