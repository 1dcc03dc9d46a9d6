#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a clean clone to a first picture: installs what is missing, builds Virga, makes smoke and renders it.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install-deps.sh
scripts/build.sh release virga

virga=build/release/virga
mkdir -p out
echo "making smoke, 128 voxels a side, and a scene around it"
"$virga" make smoke --resolution 128 --seed 1 -o out/demo.vdb --scene out/demo.xml
"$virga" render out/demo.xml --size 512x512 --spp "${VIRGA_DEMO_SPP:-64}" -o out/demo.exr -o out/demo.png

cat <<'TEXT'

The picture:  out/demo.png  (to look at)
              out/demo.exr  (linear, to compute with)
Try next:
  build/release/virga render out/demo.xml --error 1e-3 --layers -o out/better.exr
  build/release/virga compare out/demo.exr out/better.exr
  build/release/virga render out/demo.xml -m ims --set ims.mode=fast --passes 1 -o out/fast.png
  build/release/virga info out/better.exr
  build/release/virga make cloud -o out/cloud.vdb && build/release/virga render out/cloud.vdb -o out/cloud.png
  build/release/virga render --help
The tests:      scripts/test.sh
What a scene is made of:  docs/first-picture.md
TEXT
