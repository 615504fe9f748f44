#!/bin/bash
# SPDX-License-Identifier: MIT
#
# demo_gif.sh SAGA FOLDER OUT.gif: makes the README's animated picture from the
# results of tools/demo.sh in FOLDER. Three panels run side by side at half
# speed: the pictures of a held-out camera (cam03), the file drawn from this
# camera, and the file drawn along a path between the cameras.
set -euo pipefail
saga=$1
demo=$2
out=$3
file=$demo/demo.saga
fps=12
colours=112 # all frames share a palette; fewer make a smaller file

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
"$saga" render "$file" --camera 3 --frames 0:24 -o "$tmp/held%03d.png"
"$saga" render "$file" --orbit 24 --size 320x180 -o "$tmp/orbit%03d.png"
ffmpeg -v error -y -framerate $fps -i "$demo/capture/images/cam03/%05d.png" \
    -framerate $fps -i "$tmp/held%03d.png" \
    -framerate $fps -i "$tmp/orbit%03d.png" -filter_complex \
    "hstack=3,scale=816:-1:flags=area,split[a][b];
     [a]palettegen=max_colors=$colours[p];
     [b][p]paletteuse=dither=none:diff_mode=rectangle" "$out"
