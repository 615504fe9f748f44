#!/bin/bash
# SPDX-License-Identifier: MIT
#
# x265_points.sh CAPTURE NBYTES...: prints the PSNR that H.265 reaches on a
# capture's videos if all of them together have NBYTES. Each camera is a
# separate stream, coded by x265 with the preset medium and --tune psnr.
# Wavefronts, and the description of itself that x265 writes into each stream,
# are turned off, because they only cost bytes (lab/simulcast.py does the same).
# The PSNR is computed from the squared error over all frames of a camera, R, G
# and B, and then averaged over cameras (`saga eval --json`: psnr_of_mean_mse).
# It is interpolated between the two constant qualities (crf) nearest to NBYTES;
# the bytes and PSNR of their raw streams are printed, too.
#
# A capture is one that `saga encode` reads: camNN.mp4, videos/NAME.mp4 or
# images/NAME/*.png. Frames are compared as they were filmed, with their lens
# distortion. PRESET sets another preset. Without ffmpeg or libx265 the script
# prints a message and exits with 0.
set -euo pipefail
capture=$1
shift
preset=${PRESET:-medium}

if [[ $(ffmpeg -hide_banner -encoders 2>/dev/null) != *libx265* ]]; then
    echo "x265_points: no ffmpeg with libx265, so nothing is measured"
    exit 0
fi
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

# A line for each camera: ffmpeg's input options, separated by tabs.
cameras() {
    local fps at
    fps=$(sed -n 's/.*"fps": *\([0-9.]*\).*/\1/p' \
        "$capture/transforms.json" 2>/dev/null | head -n 1) || :
    for at in "$capture"/cam*.mp4 "$capture"/videos/*.mp4; do
        [ ! -f "$at" ] || printf -- '-i\t%s\n' "$at"
    done
    for at in "$capture"/images/*/; do
        [ ! -d "$at" ] ||
            printf -- '-framerate\t%s\t-pattern_type\tglob\t-i\t%s*.png\n' \
                "${fps:-30}" "$at"
    done
}
mapfile -t inputs < <(cameras)
[ ${#inputs[@]} != 0 ] || { echo "x265_points: no camera in $capture"; exit 1; }

# The conversion to 8-bit RGB, from any source and from decoded 4:2:0.
rgb="scale=out_range=full:flags=bicubic+accurate_rnd+full_chroma_int"
rgb="$rgb+full_chroma_inp,format=gbrp"

# point CRF: prints "bytes dB" for all cameras together.
point() {
    local i=0 line in
    for line in "${inputs[@]}"; do
        IFS=$'\t' read -ra in <<<"$line"
        ffmpeg -v error -y "${in[@]}" -an -vf \
            "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p" \
            -colorspace bt709 -color_range tv -c:v libx265 \
            -preset "$preset" -tune psnr -crf "$1" \
            -x265-params log-level=error:info=0:pools=none:frame-threads=1 \
            -f hevc "$tmp/$i.hevc" </dev/null
        ffmpeg -v info -nostats -i "$tmp/$i.hevc" "${in[@]}" -lavfi \
            "[0:v]settb=1,setpts=N,$rgb[a];[1:v]settb=1,setpts=N,$rgb[b];
             [a][b]psnr" -f null - </dev/null 2>"$tmp/$i.txt"
        i=$((i + 1))
    done
    sed -n 's/.*PSNR.* average:\([0-9.]*\).*/\1/p' "$tmp"/*.txt |
        awk -v n="$(cat "$tmp"/*.hevc | wc -c)" -v want=${#inputs[@]} '
            { sum += $1 }
            END { if (NR != want) exit 1; printf "%d %.2f\n", n, sum / NR }'
}

# between WANT BYTES DB BYTES DB: prints the PSNR at WANT bytes, interpolated
# linearly in the logarithm of the bytes.
between() {
    awk -v w="$1" -v n0="$2" -v d0="$3" -v n1="$4" -v d1="$5" 'BEGIN {
        printf "%.2f\n", d0 + (d1 - d0) * log(w / n0) / log(n1 / n0) }'
}

echo "| bytes | PSNR, dB | between, bytes : dB |"
echo "|---|---|---|"
for want in "$@"; do
    # The best and the worst quality of the format, and their points.
    lo=0 hi=51 more= less=
    for _ in 1 2 3 4 5 6; do
        crf=$(awk "BEGIN { print ($lo + $hi) / 2 }")
        read -r nbytes db < <(point "$crf")
        if [ "$nbytes" -gt "$want" ]; then
            lo=$crf more="$nbytes $db"
        else
            hi=$crf less="$nbytes $db"
        fi
    done
    # shellcheck disable=SC2086
    if [ -n "$more" ] && [ -n "$less" ]; then
        echo "| $want | $(between "$want" $less $more) |" \
            "${less/ / : }, ${more/ / : } |"
    else
        echo "| $want | out of reach | $less$more |"
    fi
done
