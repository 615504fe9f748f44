#!/bin/bash
# SPDX-License-Identifier: MIT
#
# seams.sh FILE.saga CAPTURE: measures how well a file reproduces the changes
# from frame to frame, at the seams between its segments and elsewhere. CAPTURE
# comes from `saga synth`.
#
# The temporal PSNR of a pair of frames compares the changes from one frame to
# the next: each value is the difference of two 8-bit values, clipped to +-128.
# The mean squared error is taken over all cameras of a pair and over the pairs
# of a row. PSNR compares the second frames of the pairs.
#
# CSV=FILE: writes, for lab/over_time.gp, the PSNR of every frame and the
# temporal PSNR of the pair that ends with it, or 0 for the first frame.
set -eu
saga=${SAGA:-${BUILD:-build}/saga}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$saga" info "$1" --json >"$work/info"
read -r frames views seams <<<"$(python3 -c '
import json, sys
r = json.load(open(sys.argv[1]))
print(sum(s["n_frames"] for s in r["segments"]), len(r["rig"]),
      *(s["first_frame"] for s in r["segments"][1:]))' "$work/info")"

change='format=gbrp,tblend=all_mode=grainextract'
for ((v = 0; v < views; v++)); do
    "$saga" render "$1" --camera "$v" --frames "0:$frames" \
        -o "$work/%04d.png" 2>"$work/err"
    ffmpeg -v error -start_number 0 -i "$work/%04d.png" \
        -pattern_type glob -i "$2/images/$(printf 'cam%02d' "$v")/*.png" \
        -lavfi "[0]format=gbrp,split[a][b];[1]format=gbrp,split[c][d];
                [a]$change[e];[c]$change[f];
                [e][f]psnr=stats_file=$work/change.$v[x];
                [b][d]psnr=stats_file=$work/plain.$v[y]" \
        -map '[x]' -map '[y]' -f null -
done
# ffmpeg counts frames and pairs from 1; pair n ends with frame n.
awk -v seams="$seams" -v csv="${CSV:-}" '
    BEGIN { split(seams, s, " "); for (i in s) is_seam[s[i]] = 1 }
    {
        change = FILENAME ~ /change/
        split($1, n, ":")
        split($2, mse, ":")
        at = change ? n[2] : n[2] - 1
        of[at, change] += mse[2]
        views[at, change]++
        last = at > last ? at : last
        if (at > 0) {
            row = at in is_seam
            sum[row, change] += mse[2]
            count[row, change]++
        }
    }
    function db(n, sum) {
        return sum > 0 ? 10 * log(255 ^ 2 * n / sum) / log(10) : 0
    }
    function psnr(row, change) {
        return db(count[row, change], sum[row, change])
    }
    END {
        printf "%-10s %8s %14s\n", "", "PSNR, dB", "temporal PSNR"
        for (row = 0; row < 2; row++)
            if (count[row, 1])
                printf "%-10s %8.2f %14.2f\n", row ? "seams" : "elsewhere",
                       psnr(row, 0), psnr(row, 1)
        if (csv) {
            print "frame,psnr,temporal_psnr" >csv
            for (at = 0; at <= last; at++)
                printf "%d,%.3f,%.3f\n", at, db(views[at, 0], of[at, 0]),
                       db(views[at, 1], of[at, 1]) >csv
        }
    }' "$work"/change.* "$work"/plain.*
