#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_subject.sh: guarantees, for `saga encode --subject` (build/saga, or
# SAGA=...),
#   good        cameras are checked by whole pictures; the box that is reported
#               gives about the same file as --box;
#               `saga eval --subject` reports the IoU of opacity and masks,
#               which is more than that of the whole scene
#   parts       segments that are trained apart share the box of the whole film:
#               joined they are the file of a single process
#   bad         a capture without a mask, or without any, --box without
#               --subject, a box of no size and a key that is no screen's give a
#               message of one line
set -u
saga=$(realpath "${SAGA:-${BUILD:-build}/saga}")
checks=subject
. "$(dirname "$0")/verdict.sh"
cd "$tmp" || exit

run_as=("$saga" encode)
"$saga" synth cap --size 64x36 --cameras 5 --hold-out 1 --frames 4 --masks \
    --points 300 --depth-every 0 >out 2>err || complain "synth: $(cat err)"
small=(--primitives 150 --iterations 200 --moving --ablate no-teachers)

# ---- good
iou() { # iou FILE: of the training views
    "$saga" eval "$1" cap --subject --no-ssim --json 2>err |
        python3 -c 'import json, sys; print(json.load(sys.stdin)["training"]["iou"])'
}
expect 0 cap -o s.saga "${small[@]}" --subject
! grep -q 'Noise instead' err || complain "checked without what is behind"
box=$(sed -n 's/.* within --box \(.*\)/\1/p' err)
[ "$(tr -dc , <<<"$box" | wc -c)" = 5 ] || complain "no box: $(cat err)"
expect 0 cap -o box.saga "${small[@]}" --subject --box="$box"
[ "$(sed -n 's/.* within --box \(.*\)/\1/p' err)" = "$box" ] ||
    complain "another box: $(cat err)"
expect 0 cap -o whole.saga "${small[@]}"
python3 -c 'import sys; a, b, c = map(float, sys.argv[1:]); sys.exit(
    not (a > 2 * c and abs(a - b) < 0.1))' "$(iou s.saga)" "$(iou box.saga)" \
    "$(iou whole.saga)" || complain "IoU $(iou s.saga), with --box" \
    "$(iou box.saga), without --subject $(iou whole.saga)"
verdict good

# ---- parts
two=("${small[@]}" --subject --segment 2)
expect 0 cap -o seg.saga "${two[@]}"
grep -q 'no base: a subject is taken to move' err || complain "$(cat err)"
expect 0 cap -o nets "${two[@]}" --networks-only
for k in 0 1; do
    expect 0 cap -o "part_$k.saga" "${two[@]}" --only $k --networks nets
done
"$saga" join part_0.saga part_1.saga -o joined.saga >out 2>err ||
    complain "join: $(cat err)"
# A part has no viewing volume.
"$saga" volume seg.saga --none -o bare.saga >out 2>err || complain "$(cat err)"
cmp -s joined.saga bare.saga || complain "two parts: another file"
verdict parts

# ---- bad
told 2 'give --subject or --key too' cap -o x.saga --box=0,0,0,1,1,1
told 2 "not '0,0,0,1,1,0'" cap -o x.saga --subject --box=0,0,0,1,1,0
expect 1 cap -o x.saga --key 808080
grep -q 'no channel is above the others by 64' err || complain "$(cat err)"
told 2 "not '0,0,0,1,1'" cap -o x.saga --subject --box=0,0,0,1,1
rm cap/masks/cam03/00001.png
expect 1 cap -o x.saga --subject
grep -q 'cam03/00001.png: nothing tells the subject' err || complain "$(cat err)"
rm -r cap/masks
expect 1 cap -o x.saga --subject
grep -q 'cam00/00000.png: nothing tells the subject' err || complain "$(cat err)"
[ ! -e x.saga ] || complain "a file of what was refused"
verdict bad
