#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_encode.sh: guarantees, for `saga encode` (build/saga, or SAGA=...),
#   good        a capture is encoded to a file that `saga info` accepts; the
#               report, as text and JSON, states its size; no checkpoint
#               remains; two threads make the same bytes
#   size        --size and --bitrate are met within 5 %, or a miss is reported
#   stopped, interrupted
#               Ctrl-C and SIGTERM end a run with status 2 and a checkpoint, and
#               --resume then makes the bytes of a run that was not stopped;
#               without --resume a checkpoint is not overwritten, and --resume
#               without a checkpoint does not overwrite a finished file;
#               --resume --finish makes a file of the warm-up after a tenth of
#               the time, and --resume goes on from there to the same bytes; a
#               second Ctrl-C leaves no incomplete file; a resumed run reports
#               its progress as percent of the whole training; `saga info`
#               describes a checkpoint
#   exposure    if cameras are exposed differently, the table states with which
#               pictures each row is compared; a camera's view has the tone
#               of its pictures, in encode, eval and render; with --no-exposure
#               it has that of the file, and segments keep their bytes
#   refined     cameras that are slightly wrong are refined, which is reported,
#               and `saga eval` compares the file with the capture as it is;
#               with --no-refine they are used as they are, as are right ones
#   late        --late auto says where nothing is known; with SAGA_TEST_LONG and
#               studio, videos of unequal lengths are paired by what moves, as
#               `saga eval` confirms
#   alone       two runs cannot write the same file at a time; the temporary
#               files of a killed run are removed
#   segments    --segment makes a file of several segments, which eval, info,
#               cut and saga-dec accept; a killed run resumes in the segment
#               that it was training
#   layers      --layers makes a file that `saga cut --layers` cuts to the bytes
#               that were reported, with the reported quality by `saga eval`; a
#               file without layers is refused
#   parts       two ranks that train one segment each, joined by `saga join`,
#               make the bytes of a single process, in any order; a part that
#               is finished is left alone, with status 0; parts that do not fit
#               each other, are missing or are given twice are refused
#   log         --log writes every tenth iteration, as CSV and as JSON lines;
#               the log of a resumed run equals that of a run that was not
#               stopped
#   sweep       --sweep makes files with ever more primitives, their results,
#               and the curve of the results that no other result beats, which
#               `saga report` reads; the largest has the bytes of a training
#               of its own; a stopped sweep continues to the same files, but
#               not with other options
#   usage       wrong values end with status 2 and one line that names them
#   capture     a damaged picture, an unknown view or frame ends with status 1
#   output      a missing output folder is reported before training; a full
#               disk ends with status 2; no incomplete file remains
#   memory      with any limit of memory, from far too little to just enough,
#               a message says how much was wanted, and no incomplete file
#               remains
set -u
saga=$(realpath "${SAGA:-${BUILD:-build}/saga}")
dec=$(realpath "${SAGA_DEC:-${BUILD:-build}/saga-dec}")
shared=$(realpath "$(dirname "$0")/../../../shared/data" 2>/dev/null)
checks=encode
. "$(dirname "$0")/verdict.sh"
cd "$tmp" || exit

run_as=("$saga" encode)

# leaves NAME...: checks that the folder has only the captures and these files.
leaves() {
    local was
    was=$(ls | grep -vxF -e "$(printf '%s\n' cap broken bad out err whole.saga \
        "$@")")
    [ -z "$was" ] || complain "left behind: $was"
}

"$saga" synth cap --size 64x36 --cameras 4 --hold-out 1 --frames 4 \
    --points 300 --depth-every 0 >out 2>err || complain "synth: $(cat err)"
small=(--primitives 150 --iterations 120 --moving --ablate no-teachers)

# ---- good
expect 0 cap -o whole.saga "${small[@]}" -v
size=$(stat -c %s whole.saga)
grep -q "^whole.saga: $size bytes" out || complain "size: $(head -n 1 out)"
for word in 'things that stand still: ' 'from between the cameras the scene looks' \
    'PSNR of the decoded file: .* dB for the training views, .* for held-out' \
    ' kB a second (' 'next: saga view whole.saga' \
    'integer decoder' 'training  held out' 'networks'; do
    grep -q "$word" out || complain "no '$word' in the report"
done
"$saga" info whole.saga >out 2>err || complain "info: $(cat err)"
expect 0 cap -o x.saga "${small[@]}" --hold-out ""
grep -q 'no camera was held out' out || complain "no word of held-out views"
[ "$(wc -l <out)" -le 9 ] && ! grep -qE 'entropy|float|coarse' out ||
    complain "tables for research without -v: $(cat out)"
rm -f x.saga
expect 0 cap -o j.saga "${small[@]}" --json --threads 2
python3 -c '
import json, sys
r = json.load(open("out"))
assert r["schema"] == 1 and r["command"] == "encode"
assert r["nbytes"] == sum(r["bytes"].values()) == int(sys.argv[1]), r["bytes"]
assert r["temporal"] is True and r["level"] == 2
parts = r["psnr_parts"]
assert 0.001 < parts["moving_share"] < 0.5 and parts["moving_as_still"] < 30
low, high = sorted((parts["still"], parts["moving"]))
assert low - 1 < r["psnr"]["training"] < high + 1, (parts, r["psnr"])
assert r["psnr"]["training"] > 5 and r["psnr"]["n_held_out"] == 4
gap = r["psnr"]["training"] - r["psnr"]["held_out"]
assert r["between_cameras"] == ("good" if gap <= 1 else "soft"), (gap, r)
' "$size" 2>>bad || complain "JSON: $(cat out)"
cmp -s whole.saga j.saga || complain "two threads, another file"
rm -f j.saga
expect 0 cap -o still.saga --primitives 150 --iterations 120 --frames 1:2
! grep -q 'bit/s' out || complain "a still has a rate: $(grep 'bit/s' out)"
grep -q '^  4 views, 1 frame;' out || complain "a still: $(head -n 2 out)"
"$saga" info still.saga >out 2>err || complain "info: $(cat err)"
! grep -q 'per second' out || complain "a still: $(grep 'per second' out)"
rm -f still.saga
leaves
verdict good

# ---- size: of 4 frames at 24 a second 384 kbit/s are 8,000 bytes
expect 0 cap -o z.saga --size 0.008M --iterations 1200 --moving
size=$(stat -c %s z.saga)
[ "$size" -ge 7600 ] && [ "$size" -le 8400 ] || complain "$size bytes"
for ask in '--size 0.008M' '--bitrate 384k'; do
    # shellcheck disable=SC2086
    expect 0 cap -o z.saga $ask --iterations 60 --moving
    grep -q '400 primitives, chosen for the size' err || complain "why primitives: $(cat err)"
    [ ! -f z.first ] || cmp -s z.saga z.first || complain "$ask: another file"
    mv z.saga z.first
done
expect 0 cap -o z.saga --size 6k --primitives 2000 --iterations 60
grep -q 'more than asked for; fewer --primitives' err ||
    complain "not a word of a missed size: $(cat err)"
rm z.*
leaves
verdict size

# ---- stopped
stop() { # stop SIGNAL: a longer run, stopped after its first checkpoint
    $stoppable "$saga" encode cap -o s.saga --primitives 150 \
        --iterations 1500 --checkpoint-every 0 >out 2>err </dev/null &
    local pid=$! i=0
    while [ ! -f s.saga.ckpt ] && [ $i -lt 500 ]; do
        sleep 0.02
        i=$((i + 1))
    done
    kill "-$1" "$pid"
    wait "$pid"
    rc=$?
}
"$saga" encode cap -o s.saga --primitives 150 --iterations 1500 >out 2>err
mv s.saga s.whole
# Without job control, a background job of a script ignores SIGINT.
set -m
for signal in INT TERM; do
    stop $signal
    [ "$rc" = 2 ] || complain "$signal: status $rc: $(cat err)"
    grep -q -e '--resume' err || complain "$signal: $(cat err)"
    [ -f s.saga ] && complain "$signal: a file already"
    leaves s.saga.ckpt s.saga.ckpt.csv s.whole
    expect 0 cap -o s.saga --resume --finish
    says 's.saga has what was trained so far, 4 frames in'
    "$dec" s.saga --camera rig:1 --time 0 --crc >out 2>err ||
        complain "finished early: $(cat err)"
    "$saga" volume s.saga --json 2>err | grep -q '"pivot"' ||
        complain "finished early: no viewing volume; $(cat err)"
    rm -f s.saga
    told 2 s.saga.ckpt cap -o s.saga --primitives 150 --iterations 1500
    expect 2 cap -o s.saga --primitives 150 --iterations 1000 --resume
    says '--iterations 1500, not 1000'
    expect 0 cap -o s.saga --primitives 150 --iterations 1500 --resume
    cmp -s s.saga s.whole || complain "$signal: resumed to another file"
    expect 0 cap -o s.saga --primitives 150 --iterations 1500 --resume
    says 's.saga is already finished'
    cmp -s s.saga s.whole || complain "$signal: finished to another file"
    leaves s.saga s.whole
    rm -f s.saga
done
set +m
expect 0 cap -o s.saga "${small[@]}" --resume
grep -q 'starts from the beginning' err || complain "--resume of nothing: $(cat err)"
cmp -s s.saga whole.saga || complain "--resume of nothing: another file"
echo 'of another capture' >s.saga
expect 2 cap -o s.saga "${small[@]}" --resume
says 's.saga exists and is not a file of this command, and there is no checkpoint s.saga.ckpt'
grep -qx 'of another capture' s.saga || complain "--resume overwrites a file"
leaves s.saga s.whole
rm -f s.saga s.whole
told 2 '--finish needs --resume' cap -o x.saga --finish
told 2 'there is no checkpoint x.saga.ckpt' cap -o x.saga --resume --finish
told 2 'leave --json' cap -o x.saga --resume --finish --json
verdict stopped

# percent.py prints the first percentage of the training that is shown on a
# terminal.
cat >percent.py <<'PYTHON'
import os, pty, re, sys

pid, terminal = pty.fork()
if pid == 0:
    os.execv(sys.argv[1], sys.argv[1:])
text = b""
while True:
    try:
        more = os.read(terminal, 1000)
    except OSError:
        break
    if not more:
        break
    text += more
os.waitpid(pid, 0)
print(next(int(p) for p, doing in re.findall(rb"(\d+) %  (\w+-?\w*)", text)
           if doing in (b"warm-up", b"rendering", b"packing")))
PYTHON
set -m
$stoppable "$saga" encode cap -o s.saga --primitives 150 --iterations 1500 \
    --ablate no-teachers --log s.csv >out 2>err </dev/null &
pid=$!
while kill -0 $pid 2>/dev/null && ! grep -q '^750,' s.csv 2>/dev/null; do
    sleep 0.01
done
kill -INT $pid
wait $pid
[ $? = 2 ] || complain "stopped half-way: $(cat err)"
"$saga" info s.saga.ckpt >out 2>err
[ $? = 1 ] || complain "info of a checkpoint: not status 1"
says 'a checkpoint of `saga encode`'
says '`saga view` shows it'
percent=$(python3 percent.py "$saga" encode cap -o s.saga --primitives 150 \
    --iterations 1500 --ablate no-teachers --resume)
[ "${percent:-0}" -ge 30 ] || complain "a resumed run begins at $percent %"
# The first checkpoint comes after a tenth of the time, however long the
# interval is, and what it shows is better than a grey picture.
$stoppable "$saga" encode cap -o e.saga --primitives 150 --iterations 3000 \
    --ablate no-teachers --log e.csv >out 2>err </dev/null &
pid=$!
while kill -0 $pid 2>/dev/null && [ ! -f e.saga.ckpt ]; do sleep 0.01; done
grep -q '^1500,' e.csv && complain "the first checkpoint: $(tail -n 1 e.csv)"
kill -KILL $pid
wait $pid 2>/dev/null
touch e.saga.ckpt.finish # of the page's button
expect 0 cap -o e.saga --resume --finish
[ ! -e e.saga.ckpt.finish ] || complain "the request that was answered remains"
"$saga" eval e.saga cap --json >out 2>err
python3 -c '
import json
assert json.load(open("out"))["training"]["psnr"] > 18
' 2>>bad || complain "after a tenth: $(cat out err)"
rm -f e.saga e.saga.* e.csv
rm -f s.saga s.csv percent.py
for ((i = 0; i < 20; i++)); do
    $stoppable "$saga" encode cap -o s.saga --primitives 3000 \
        --iterations 3000 --log s.csv >out 2>err </dev/null &
    pid=$!
    while kill -0 $pid 2>/dev/null && ! grep -q '^20,' s.csv 2>/dev/null; do
        sleep 0.01
    done
    kill -INT $pid
    # Two pending signals of the same number are delivered as one, so that the
    # second is sent only after the first was handled.
    while grep -q '^ShdPnd:.*2$' /proc/$pid/status 2>/dev/null; do :; done
    kill -INT $pid 2>/dev/null
    wait $pid 2>/dev/null
    rc=$?
    rm -f s.saga.ckpt s.saga.ckpt.csv s.csv
    [ $rc = 130 ] && break
done
[ $rc = 130 ] || complain "two Ctrl-C: status $rc: $(cat err)"
set +m
leaves
verdict interrupted

# ---- exposure
# cam02 has half of the light.
"$saga" synth dim --size 64x36 --cameras 4 --hold-out 0 --frames 1 \
    --samples 1 --depth-every 0 --points 600 >out 2>err ||
    complain "synth: $(cat err)"
ffmpeg -nostdin -v error -y -i dim/images/cam02/00000.png \
    -vf lutrgb=r=val*.6:g=val*.6:b=val*.6 dim.png &&
    mv dim.png dim/images/cam02/00000.png
expect 0 dim -o x.saga --primitives 300 --iterations 300 -v
grep -q 'compared with the pictures with evened exposures' out &&
    grep -q 'compared with the pictures as they were taken' out &&
    [ "$(grep -c 'file, integer decoder' out)" = 2 ] ||
    complain "a table without words: $(grep -A9 'mean PSNR' out)"
expect 0 dim -o x.saga --primitives 300 --iterations 300 --json
python3 -c '
import json
r = json.load(open("out"))
float, file, taken = [r[k]["training"] for k in (
    "psnr_decoded_float", "psnr_evened", "psnr")]
assert abs(float - file) < 0.3 and taken > file - 1, (float, file, taken)
' 2>>bad || complain "JSON: $(grep -A9 psnr out)"
"$saga" info x.saga --json >info 2>err || complain "info: $(cat err)"
"$saga" eval x.saga dim --json >eval 2>err || complain "eval: $(cat err)"
for tone in "" --no-exposure; do
    "$saga" render x.saga --camera 2 $tone -o "tone$tone.png" >/dev/null \
        2>err || complain "render $tone: $(cat err)"
done
expect 0 dim -o y.saga --primitives 300 --iterations 300 --no-exposure --json
"$saga" info y.saga --json >info_y && "$saga" eval y.saga dim --json >eval_y &&
    "$saga" render y.saga --camera 2 -o y.png >/dev/null 2>err ||
    complain "a file without exposures: $(cat err)"
cmp y.png tone--no-exposure.png ||
    complain "--no-exposure draws another picture than the file without"
python3 -c '
import json, subprocess
info, other, r, e, f = [json.load(open(n)) for n in (
    "info", "info_y", "out", "eval", "eval_y")]
# The chunk has 12 bytes and 6 for each camera; nothing else differs.
n = len(info["rig"])
assert info["nbytes"] - other["nbytes"] == 12 + 6 * n
assert info["bytes"]["exposures"] == 6 * n and not other["bytes"]["exposures"]
gains = [c["exposure"] for c in info["rig"]]
assert not other["exposure"] and "exposure" not in other["rig"][0]
assert info["exposure"]["least_gain"] == min(map(min, gains))
assert 0.55 < gains[2][0] / gains[1][0] < 0.65, gains
# eval as filmed: what encode says, near the best tone, far from the tone
# of the file.
filmed = json.load(open("out"))["psnr"]["training"]
assert filmed < r["psnr_evened"]["training"] - 2
psnr = [x["training"]["psnr"] for x in (e, f)]
best = [x["training"]["psnr_exposed"] for x in (e, f)]
assert abs(psnr[1] - filmed) < 0.01 and psnr[0] > psnr[1] + 2, (psnr, filmed)
assert psnr[0] > best[0] - 0.5 and abs(best[0] - best[1]) < 0.2, (psnr, best)
# Every sample is min(255, (s gain + 2048) >> 12).
def rgb(name):
    return subprocess.run(["ffmpeg", "-v", "error", "-i", name, "-f",
                           "rawvideo", "-pix_fmt", "rgb24", "-"], check=True,
                          capture_output=True).stdout
q12 = [round(4096 * g) for g in gains[2]]
assert rgb("tone.png") == bytes(min(255, s * q12[i % 3] + 2048 >> 12)
                                for i, s in enumerate(rgb("y.png")))
' 2>>bad || complain "the tone of cameras: $(tail -n 1 bad)"
expect 0 cap -o x.saga "${small[@]}" -v
! grep -q 'compared with the pictures' out || complain "words of no exposure"
rm -rf dim x.saga y.saga info info_y eval eval_y y.png tone.png \
    tone--no-exposure.png
leaves
verdict exposure

# ---- refined
"$saga" synth poses --size 240x136 --cameras 5 --hold-out 0 --frames 1 \
    --depth-every 0 --points 400 >out 2>err || complain "synth: $(cat err)"
python3 - <<'PYTHON' 2>>bad
import json

with open("poses/transforms.json") as f:
    j = json.load(f)
for i, f in enumerate(j["frames"]):
    f["fl_x"] = f["fl_y"] = j["fl_x"] * (1.01, 0.99, 1.005)[i % 3]
    # Turn the camera by 0.3 degrees about its x or y axis.
    for row in f["transform_matrix"][:3]:
        row[i % 2] += (0.0052, -0.0052)[i // 2 % 2] * row[2]
with open("poses/moved.json", "w") as f:
    json.dump(j, f)
PYTHON
few=(--primitives 200 --iterations 90 --ablate no-teachers --json)
for way in "poses/moved.json" "poses/moved.json --no-refine" "poses"; do
    # shellcheck disable=SC2086
    expect 0 $way -o x.saga "${few[@]}"
    python3 -c '
import json, sys
r = json.load(open("out"))["refinement"]
assert (r is not None) == (sys.argv[1] == "poses/moved.json"), (sys.argv, r)
assert r is None or r["after_px"] < 0.8 * r["before_px"], r
told = "poses and lenses are refined" in open("err").read()
assert told == (r is not None)
' "$way" 2>>bad || complain "$way: $(cat err)"
    psnr=$(python3 -c '
import json
print(json.load(open("out"))["psnr"]["training"])')
    "$saga" eval x.saga "${way% *}" --json >eval 2>err ||
        complain "eval of $way: $(cat err)"
    # The picture is compared with the camera that the file has.
    python3 -c '
import json, sys
got = json.load(open("eval"))["training"]["psnr"]
assert abs(got - float(sys.argv[1])) < 0.01, (got, sys.argv)
' "$psnr" 2>>bad || complain "$way: another PSNR"
done
rm -rf poses x.saga eval
leaves
verdict refined

# ---- late
expect 0 cap -o x.saga "${small[@]}" --late auto
grep -q 'of 4 of 4 cameras what moves does not tell' err ||
    complain "--late auto: $(cat err)"
cmp x.saga whole.saga || complain "--late auto without a delay: other bytes"
studio=$shared/studio
if [ -n "${SAGA_TEST_LONG:-}" ] && [ -d "$studio" ]; then
    mkdir studio
    cp "$studio"/cam*.mp4 "$studio/poses_bounds.npy" studio
    ffmpeg -v error -y -i "$studio/cam03.mp4" \
        -vf trim=start_frame=2,setpts=PTS-STARTPTS -c:v libx264 -qp 0 \
        studio/cam03.mp4 2>err || complain "ffmpeg: $(cat err)"
    expect 0 studio -o x.saga --scale 1/3 --primitives 200 --iterations 60
    grep -q 'paired as with --late cam03=-2;' err ||
        complain "unequal lengths: $(cat err)"
    "$saga" eval x.saga studio --scale 1/3 --late cam03=-2 >out 2>err ||
        complain "eval: $(cat err)"
fi
rm -rf studio x.saga
leaves
verdict late

# ---- segments
expect 0 cap -o seg.saga "${small[@]}" --segment 2
grep -q '4 views, 4 frames in 2 segments' out || complain "$(head -n 2 out)"
expect 0 cap -o seg.saga "${small[@]}" --segment 2 --json
grep -q '"n_segments": 2' out || complain "JSON: no n_segments"
"$saga" info seg.saga --json >out 2>err || complain "info: $(cat err)"
python3 -c '
import json
s = json.load(open("out"))["segments"]
assert [(x["first_frame"], x["n_frames"]) for x in s] == [(0, 2), (2, 2)], s
' 2>>bad || complain "segments: $(cat out)"
"$saga" eval seg.saga cap --json >out 2>err || complain "eval: $(cat err)"
python3 -c '
import json
r = json.load(open("out"))
assert r["protocol"]["frames"] == [0, 4] and r["decode_ms"]["n_segments"] == 2, r
' 2>>bad || complain "eval: $(cat out)"
"$saga" cut seg.saga 2:4 -o late.saga >out 2>err || complain "cut: $(cat err)"
for time in 3/2:x 2/1:0/1 7/2:3/2; do
    "$dec" seg.saga --camera rig:1 --time ${time%:*} --crc >out 2>err ||
        complain "saga-dec: $(cat err)"
    [ "${time#*:}" = x ] && continue
    "$dec" late.saga --camera rig:1 --time ${time#*:} --crc >alone 2>err
    cmp -s out alone || complain "segment 1 alone at $time is another picture"
done
set -m
$stoppable "$saga" encode cap -o k.saga "${small[@]}" --segment 2 \
    --log k.csv --checkpoint-every 0 >out 2>err </dev/null &
pid=$!
while kill -0 "$pid" 2>/dev/null && ! grep -q '^150,' k.csv 2>/dev/null; do
    sleep 0.01
done
kill -KILL "$pid"
wait "$pid" 2>/dev/null
set +m
told 2 'a number of segments of 2, not 1' cap -o k.saga "${small[@]}" --resume
expect 0 cap -o k.saga "${small[@]}" --segment 2 --resume
cmp -s k.saga seg.saga || complain "killed in a segment: another file"
told 2 "'1'" cap -o x.saga --segment 1
rm -f late.saga k.saga k.csv alone
leaves seg.saga
verdict segments

# ---- layers
expect 0 cap -o lay.saga "${small[@]}" --segment 2 --layers 2 --json
mv out told
"$saga" cut lay.saga : --layers 1 -o first.saga >out 2>err ||
    complain "cut: $(cat err)"
for f in first lay; do
    "$saga" eval $f.saga cap --json >$f.json 2>err ||
        complain "eval: $(cat err)"
done
python3 -c '
import json, os
told = json.load(open("told"))["layers"]
assert len(told) == 2
for name, layer in zip(("first", "lay"), told):
    judged = json.load(open(name + ".json"))
    assert layer["nbytes"] == os.path.getsize(name + ".saga"), layer
    for key in ("training", "held_out"):
        apart = judged[key]["psnr"] - layer["psnr"][key]
        assert abs(apart) < 1e-4, (name, key, apart)
' 2>>bad || complain "layers: $(cat told)"
expect 2 cap -o x.saga --layers 2 --networks-only
says '--layers needs all segments trained in one place'
told 2 "takes auto or paper, not 'all'" cap -o x.saga --model all
told 2 'have no memory bank' cap -o x.saga --layers 2 --ablate slots=32
told 2 "'9'" cap -o x.saga --layers 9
rm -f lay.saga first.saga lay.json first.json told
leaves seg.saga
verdict layers

# ---- parts
expect 0 cap -o nets "${small[@]}" --segment 2 --networks-only
grep -q '^nets: networks of 2 segments' out || complain "$(head -n 1 out)"
# rank R SIZE: trains every SIZE-th segment from R on, as docs/scale.md
# describes.
rank() {
    local k
    for k in $(seq "$1" "$2" 1); do
        "$saga" encode cap -o "part_$k.saga" "${small[@]}" --segment 2 \
            --only "$k" --networks nets --resume --json >"part_$k.json" \
            2>"part_$k.err" </dev/null || complain "$(tail -n 1 "part_$k.err")"
    done
}
rank 0 2 &
rank 1 2
wait
grep -q '"segment": 1' part_1.json || complain "JSON: no segment"
mv part_0.err part_0.first
rank 0 1 # a scheduler runs finished jobs again
grep -q 'part_0.saga is already finished' part_0.err || complain "$(cat part_0.err)"
expect 0 cap -o nets "${small[@]}" --segment 2 --networks-only --resume
says 'nets is already finished'
# The instruction set: forced, named, and the same for all parts or a warning.
SAGA_CPU=baseline expect 0 cap -o base.saga "${small[@]}" --segment 2 --only 0 \
    --networks nets
grep -q 'encode: instruction set baseline' err || complain "$(cat err)"
if grep -q 'instruction set x86-64' part_0.first; then
    grep -q 'nets was computed with instruction set x86-64-v3, so' err ||
        complain "no word of two instruction sets: $(cat err)"
    ! cmp -s base.saga part_0.saga || complain "SAGA_CPU changes nothing"
fi
! grep -q 'was computed with' part_0.first || complain "$(cat part_0.first)"
SAGA_CPU=x86-64-v9 expect 2 cap -o x.saga "${small[@]}"
says "SAGA_CPU: is 'x86-64-v9', which this machine does not have"
rm -f base.saga base.saga.part
# On a machine without AVX the program gives the bytes of the baseline. The
# variable of OpenMP keeps the program from starting again outside of qemu.
if [ -n "${SAGA_TEST_LONG:-}" ] && command -v qemu-x86_64-static >/dev/null; then
    SAGA_CPU=baseline expect 0 cap -o base.saga --primitives 50 --iterations 40
    OMP_WAIT_POLICY=passive qemu-x86_64-static -cpu Nehalem "$saga" encode cap \
        -o old.saga --primitives 50 --iterations 40 >out 2>err </dev/null ||
        complain "without AVX: status $?: $(tail -n 1 err)"
    cmp -s base.saga old.saga || complain "without AVX: another file"
    rm -f base.saga old.saga
fi
expect 2 cap -o part_0.saga "${small[@]}" --segment 2 --only 1 --networks nets \
    --resume
says 'part_0.saga exists and is not the part of this command'
# join STATUS SAYS [OPTION]: joins both parts, in the wrong order.
join() {
    "$saga" join part_1.saga part_0.saga -o joined.saga ${3-} >out 2>err
    [ $? = "$1" ] && grep -q -e "$2" out err ||
        complain "join, not '$2': $(cat out err)"
}
join 0 'joined.saga: '
# A part has no viewing volume.
"$saga" volume seg.saga --none -o bare.saga >out 2>err || complain "$(cat err)"
cmp -s joined.saga bare.saga || complain "two ranks: another file"
[ ! -e joined.saga.part ] || complain "a whole film is a part"
# In a film of four segments these two parts are 0 and 3, or 0 and 1.
sed -i 's/ of 2$/ of 4/' part_?.saga.part
join 1 'these are missing: 2 to 3; give'
join 0 'these are missing: 2 to 3' --allow-gaps
grep -qx 'segments 0:2 of 4' joined.saga.part || complain "joined: no record"
sed -i 's/1:2/3:4/' part_1.saga.part
join 1 'these are missing: 1 to 2; give'
join 0 'these are missing: 1 to 2' --allow-gaps
[ ! -e joined.saga.part ] || complain "a film with a hole is a part"
sed -i 's/3:4/0:1/' part_1.saga.part
join 1 'part_.*saga: holds segment 0, as part_'
sed -i 's/0:1/1:2/; s/^training .*/training 01234567/' part_1.saga.part
join 1 'part_1.saga: is of another training than part_0.saga'
sed 's/^file .*/file 01234567/' part_0.saga.part >part_1.saga.part
join 1 'part_1.saga.part: is the record of another file'
echo 'saga part 1' >part_1.saga.part
join 1 'part_1.saga.part: is no record of a part'
rm part_1.saga.part
join 1 'part_1.saga: has no record part_1.saga.part'
expect 2 cap -o x.saga "${small[@]}" --segment 2 --only 0
says '--networks FILE go together'
expect 2 cap -o x.saga "${small[@]}" --segment 2 --only 2 --networks nets
says 'has 2 segments'
expect 2 cap -o x.saga "${small[@]}" --segment 2 --only 0 --networks seg.saga
says 'seg.saga'
expect 2 cap -o x.saga "${small[@]}" --segment 2 --only 0 --networks nets \
    --seed 2
says 'was begun with --seed 1, not 2'
told 2 'there are no parts' cap -o x.saga "${small[@]}" --networks-only
told 2 'give --lambda' cap -o x.saga --segment 2 --size 30k --networks-only
rm -f nets part_* joined.saga seg.saga bare.saga
leaves
verdict parts

# ---- log
log() { # log STATUS NAME OPTIONS...: to NAME; its lines without times in kept
    local want=$1 name=$2
    shift 2
    expect "$want" cap -o l.saga "${small[@]}" --log "$name" "$@"
    sed -e 's/,[^,]*$//' "$name" >kept
}
log 0 l.csv
[ "$(head -n 1 l.csv)" = iteration,stage,psnr,bits,seconds ] ||
    complain "CSV begins with $(head -n 1 l.csv)"
[ "$(cut -d, -f1,2 kept | tail -n +2 | tr '\n' ' ')" = "$(for i in $(seq 12)
    do echo "${i}0,$([ $i -le 7 ] && echo warm-up || echo rendering)"
    done | tr '\n' ' ')" ] || complain "CSV: $(cat l.csv)"
mv kept whole.kept
cmp -s l.saga whole.saga || complain "with a log another file"
rm l.csv
set -m
$stoppable "$saga" encode cap -o l.saga "${small[@]}" --log l.csv \
    --checkpoint-every 0 >out 2>err </dev/null &
pid=$!
while [ ! -s l.csv ] || [ "$(wc -l <l.csv)" -lt 6 ]; do
    kill -0 "$pid" 2>/dev/null || break
    sleep 0.01
done
kill -KILL "$pid"
wait "$pid" 2>/dev/null
set +m
echo 'half of a li' >>l.csv
log 0 l.csv --resume
cmp -s kept whole.kept || complain "the log of a resumed run: $(cat kept)"
log 0 l.jsonl
python3 -c '
import csv, json
rows = list(csv.DictReader(open("l.csv")))
lines = [json.loads(line) for line in open("l.jsonl")]
assert len(rows) == len(lines) == 12
for row, line in zip(rows, lines):
    assert list(row) == list(line), line
    assert row["stage"] == line["stage"]
    for key in "iteration", "psnr", "bits":
        assert float(row[key]) == line[key], (key, row, line)
assert float(rows[6]["bits"]) == 0 < float(rows[7]["bits"])
' 2>>bad || complain "JSON lines: $(head -n 2 l.jsonl)"
# Between views that are far apart teachers must be trained first, except with
# the preset fast.
"$saga" synth wide --size 64x36 --cameras 3 --hold-out 0 --frames 1 \
    --points 300 --depth-every 0 >out 2>err || complain "synth: $(cat err)"
still=(-o t.saga --primitives 60 --iterations 40 --log t.csv)
expect 0 wide "${still[@]}"
[ "$(sed -n 2p t.csv | cut -d, -f2)" = teachers ] ||
    complain "a still without teachers: $(cat t.csv)"
expect 0 wide "${still[@]}" --preset fast
grep -q teachers t.csv && complain "fast has teachers"
expect 0 cap "${still[@]}" --frames 0:1
grep -q teachers t.csv && complain "views that are near have teachers"
rm -r wide t.saga t.csv
told 2 nowhere/l.csv cap -o x.saga --log nowhere/l.csv
told 2 'FILE.jsonl' cap -o x.saga --log l.txt
rm -f l.* kept whole.kept
leaves
verdict log

# ---- sweep
curve=(--sweep --primitives 60 --iterations 60 --frames 0:2 --threads 1)
expect 0 cap -o curve "${curve[@]}"
grep -q '^curve/4.saga  *60 ' out || complain "sweep: $(cat out)"
"$saga" report curve/curve.json -o page.html 2>err || complain "$(cat err)"
for i in 1 2 3 4 5; do "$saga" info curve/$i.saga --json >info.$i; done
python3 -c '
import json, os
made = [json.load(open("curve/%d.json" % i)) for i in range(1, 6)]
assert [r["encode"]["n_primitives"] for r in made] == [12, 20, 35, 60, 104]
for i, r in enumerate(made):
    assert r["nbytes"] == os.path.getsize("curve/%d.saga" % (i + 1))
    assert r["encode"]["options"]["iterations"] == 60, r["encode"]["options"]
    volume = json.load(open("info.%d" % (i + 1)))["volume"]
    assert r["volume"].keys() == volume.keys(), r["volume"]
    for key in "nearest", "psnr_between":
        assert abs(volume[key] - r["volume"][key]) < 1e-4, (key, volume)
def at(r):
    db = [v["psnr"] for v in r["views"]]
    return r["nbytes"], -sum(db) / len(db)
hull = [r for r in made if not any(
    q is not r and at(q)[0] <= at(r)[0] and at(q)[1] <= at(r)[1]
    for q in made)]
assert json.load(open("curve/curve.json")) == hull, [at(r) for r in made]
' 2>>bad || complain "sweep: $(cat out)"
rm info.*
told 2 'curve is not empty; give --resume' cap -o curve "${curve[@]}"
expect 2 cap -o curve "${curve[@]}" --resume --seed 2
says 'curve/5.json was made with other options'
told 2 'is not a folder' cap -o whole.saga "${curve[@]}"
told 2 'give only one' cap -o curve/x "${curve[@]}" --size 20k
told 2 '--sweep has several' cap -o curve/x "${curve[@]}" --log l.csv
mv curve whole
set -m
$stoppable "$saga" encode cap -o curve "${curve[@]}" --checkpoint-every 0 \
    >out 2>err </dev/null &
pid=$!
while kill -0 $pid 2>/dev/null && [ ! -f curve/4.json ]; do sleep 0.01; done
kill -INT $pid
wait $pid
[ $? = 2 ] || complain "a stopped sweep: $(cat err)"
set +m
[ ! -e curve/1.json ] || complain "the sweep was not stopped"
expect 0 cap -o curve "${curve[@]}" --resume
[ "$(ls curve)" = "$(ls whole)" ] || complain "resumed: $(ls curve)"
# The largest file is that of a training of its own.
expect 0 cap -o x.saga --primitives 104 "${curve[@]:3}"
cmp -s x.saga whole/5.saga || complain "sweep: another 5.saga than alone"
rm -f x.saga
for i in 1 2 3 4 5; do
    cmp -s curve/$i.saga whole/$i.saga || complain "resumed: another $i.saga"
done
rm -rf curve whole page.html
leaves
verdict sweep

# ---- alone
start() { # a run that is still going on when it has a checkpoint
    "$saga" encode cap -o k.saga --primitives 150 --iterations 100000 \
        --checkpoint-every 0 >killed 2>&1 </dev/null &
    pid=$!
    for ((i = 0; i < 500; i++)); do
        [ -f k.saga.ckpt ] && break
        sleep 0.02
    done
}
start
told 2 'is being written by another run' cap -o k.saga "${small[@]}" --resume
kill -KILL $pid
wait $pid 2>/dev/null
rm -f killed k.saga.ckpt k.saga.ckpt.csv
ls | grep -q '^k\.saga\.saga-part-' || complain "a killed run leaves $(ls)"
touch k.saga.ckpt.saga-part-1-0
expect 0 cap -o k.saga "${small[@]}"
cmp -s k.saga whole.saga || complain "after a killed run: another file"
rm -f k.saga
leaves
verdict alone

# ---- usage
told 2 'argument is missing'
told 2 '-o' cap
told 2 '--level' cap -o x.saga --level 5
told 2 '-o is given twice, x.saga and y.saga' cap -o x.saga -o y.saga
told 2 '1024' cap -o x.saga --level 0 --primitives 1025
told 2 '--lambda -1' cap -o x.saga --lambda -1
told 2 '--lambda' cap -o x.saga --lambda nan
for word in groups=17 groups=0 groups= groups=4x groups slots=48 slots=16 \
    no-bank=1 no-ban no-banks '' no-parent, ',no-parent'; do
    expect 2 cap -o x.saga --ablate "no-bank,$word"
    says 'no-hyperprior, no-parent, no-bank, no-base, no-steep'
done
says "''"
told 2 "'nothing'" cap -o x.saga --ablate groups=4,nothing,raw-networks
expect 2 cap -o x.saga --ablate slots=256
says 'slots=256 is more than the 128 of level 2'
for also in slots=64 plain-update; do
    told 2 'no-bank excludes' cap -o x.saga --ablate "no-bank,$also"
done
told 2 '--still and --moving' cap -o x.saga --still --moving
told 2 '--iterations' cap -o x.saga --iterations 2
told 2 "'many'" cap -o x.saga --primitives many
told 2 "fast, balanced or best, not 'slow'" cap -o x.saga --preset slow
expect 2 cap -o x.saga --size 20k --lambda 3
says 'give only one of --lambda, --size, --bitrate and --sweep'
told 2 '3000 bytes is too small' cap -o x.saga --size 3k
for size in 10q 0 -1 nan 1kk k; do
    told 2 "not '$size'" cap -o x.saga --size "$size"
done
leaves
verdict usage

# ---- capture
told 1 nowhere nowhere -o x.saga
cp -r cap broken
name=$(cd broken && ls images/*/00002.png | head -n 1)
head -c 100 "cap/$name" >"broken/$name"
told 1 '00002.png: PNG is damaged' broken -o x.saga
told 1 'names "nobody"' cap -o x.saga --hold-out cam00,nobody
told 1 9 cap -o x.saga --frames 2:9
leaves
verdict capture

# ---- output
told 2 nowhere/x.saga cap -o nowhere/x.saga "${small[@]}"
[ "$(wc -c <err)" -lt 300 ] || complain "progress before: $(cat err)"
told 2 'not a file' cap -o cap "${small[@]}"
mkdir small
if mount -t tmpfs -o size=4k none small 2>/dev/null; then
    expect 2 cap -o small/x.saga "${small[@]}" --primitives 900
    grep -q 'free space' err || complain "full disk: $(cat err)"
    [ -z "$(ls small)" ] || complain "full disk leaves $(ls small)"
    umount small
else
    # The write must fail as on a full disk, because files are limited to 4
    # blocks.
    (trap '' XFSZ; ulimit -f 4
     "$saga" encode cap -o small/x.saga "${small[@]}" --primitives 900 \
        2>err | cat >out
     exit "${PIPESTATUS[0]}")
    rc=$?
    [ "$rc" = 2 ] || complain "full disk: status $rc"
    grep -q 'free space' err || complain "full disk: $(cat err)"
    [ -z "$(ls small)" ] || complain "full disk leaves $(ls small)"
fi
rmdir small
verdict output

# ---- memory
# The dynamic loader takes some MiB; with less than this saga cannot print
# anything. A checkpoint may remain, from which a run with more memory can
# continue.
n=0
rc=1
step=2500
[ -z "${SAGA_TEST_LONG:-}" ] || step=500
for kib in $(seq 12000 $step 40000); do
    rm -f m.saga.ckpt*
    (ulimit -c 0 -v "$kib"
     exec "$saga" encode cap -o m.saga --primitives 1000 --iterations 12 \
         --moving --threads 1) >out 2>err </dev/null
    rc=$?
    [ "$rc" = 0 ] && break
    [ "$n" = 0 ] && ! grep -q '^saga: ' err && continue
    n=$((n + 1))
    grep -q '^saga: encode: .*: out of memory.*; take fewer' err ||
        complain "$kib KiB: status $rc: $(tail -n 1 err)"
    grep -q 'encode: the file was written, but: ' err && rm -f m.saga
    leaves m.saga.ckpt m.saga.ckpt.csv
done
[ "$rc" = 0 ] || complain "40,000 KiB are too little"
[ "$n" -ge 4 ] || complain "memory ended $n times"
rm -f m.saga
# The stacks of the threads need memory, too.
for kib in 20000 60000 100000; do
    (ulimit -c 0 -v "$kib"
     exec "$saga" encode cap -o m.saga --primitives 1000 --iterations 12 \
         --moving --threads 100) >out 2>err </dev/null
    grep -q '^saga: encode: 100 threads: out of memory, 209715200 bytes' err ||
        complain "$kib KiB: $(tail -n 1 err)"
    leaves
done
verdict memory

all_passed
