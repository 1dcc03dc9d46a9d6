#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Renders the pictures of the documentation anew, into docs/images.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install-deps.sh
scripts/build.sh release virga

virga=build/release/virga
mkdir -p out docs/images
"$virga" make smoke --resolution 256 --seed 1 -o out/readme.vdb --scene out/readme.xml
"$virga" render out/readme.xml --size 768x768 --spp "${VIRGA_IMAGE_SPP:-512}" -o docs/images/demo.png
"$virga" render scenes/hall.xml -m ims --set ims.mode=fast --passes "${VIRGA_HALL_PASSES:-64}" -o docs/images/hall.png
"$virga" render scenes/hall.xml -m ims --set ims.mode=frame --passes 1 -o out/hall-frame.png --dots docs/images/hall-lights.png
