#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_volume.sh: guarantees, for `saga volume` (build/saga, or SAGA=...),
#   shown     the fields of a good vector come in degrees and in units of the
#             capture; a file without a volume says so, and how to find one
#   set       options change their fields and no others; pictures, cuts and
#             joins keep; --none gives the file of before
#   encoded   `saga encode` writes a volume with the PSNR that it reports
#   predicted without held-out cameras it writes the PSNR that it predicts
#             between the cameras, unless the training is too short
#   bad       a value out of its range, ends out of order, a camera that is not
#             there, a change without -o and -o without a change give a message
#             of one line, and no file; so does a damaged volume
set -u
saga=$(realpath "${SAGA:-${BUILD:-build}/saga}")
vectors=$(realpath vectors/good)
checks=volume
. "$(dirname "$0")/verdict.sh"
cd "$tmp" || exit

run_as=("$saga" volume)
# holds FILE PYTHON: evaluates a condition on the volume v of a file.
holds() {
    "$saga" volume "$1" --json 2>err | python3 -c '
import json, sys
v = json.load(sys.stdin)["volume"]
sys.exit(not eval("(" + sys.argv[1] + ")"))' "$2" || complain "$1: not $2; $(cat err)"
}

# shows PATTERN: it is in what was printed.
shows() {
    grep -q -- "$1" out || complain "no '$1' in: $(cat out)"
}

# ---- shown
# A unit of the box is 2^-22 of the capture (tests/support/gen_stream.c), and
# 32768 is half a turn.
expect 0 "$vectors/volume.saga"
shows 'begins at camera 2'
shows 'from -10 to 20 degrees up, up to 50 degrees to the sides'
shows 'expected PSNR: 39.0 dB at trained cameras, 34.0 dB between them'
holds "$vectors/volume.saga" 'abs(v["nearest"] - 4000000 / 2**22) < 1e-6 and
    abs(v["floor"] + 777777 / 2**22) < 1e-6 and
    abs(v["azimuth_degrees"] - 9102 * 180 / 32768) < 1e-6'
holds "$vectors/volume_least.saga" 'v["floor"] is None and
    v["psnr_between"] is None'
expect 0 "$vectors/sound.saga"
shows 'has no viewing volume; `saga volume .* --find -o OUT`'
verdict shown

# ---- set
expect 0 "$vectors/exposures.saga" --find -o a.saga
expect 0 a.saga --turn 12.5 --start 1 --azimuth 180 -o b.saga
shows 'all round'
holds b.saga 'abs(v["turn_degrees"] - 12.5) < 0.01 and v["start"] == 1'
"$saga" volume a.saga --json >a.json
"$saga" volume b.saga --json >b.json
python3 - <<'E' || complain "another field changed"
import json
a, b = (json.load(open(f"{n}.json"))["volume"] for n in "ab")
assert {k for k in a if a[k] != b[k]} == {"turn_degrees", "azimuth_degrees"} | (
    {"start"} if a["start"] != 1 else set())
E
"$saga" cut b.saga : -o c.saga >out 2>err || complain "cut: $(cat err)"
cmp -s b.saga c.saga || complain "a cut of all is another file"
"$saga" mux b.saga --audio none -o d.saga >out 2>err || complain "$(cat err)"
"$saga" volume d.saga --json | sed 's/d.saga/b.saga/' | cmp -s - b.json ||
    complain "without its sound a film has another volume"
expect 0 b.saga --none -o e.saga
cmp -s e.saga "$vectors/exposures.saga" || complain "--none: another file"
verdict set

# ---- encoded
"$saga" synth cap --size 64x36 --cameras 5 --hold-out 1 --frames 4 \
    --points 300 --depth-every 0 >out 2>err || complain "synth: $(cat err)"
"$saga" encode cap -o s.saga --primitives 150 --iterations 200 --moving \
    --ablate no-teachers --json >s.json 2>err || complain "$(cat err)"
python3 - "$saga" <<'E' || complain "not the PSNR of the report"
import json, subprocess, sys
report = json.load(open("s.json"))
v = json.loads(subprocess.check_output([sys.argv[1], "volume", "s.saga",
                                        "--json"]))["volume"]
psnr = report["psnr"]
assert abs(v["psnr_at_cameras"] - psnr["training"]) <= 1 / 512, (v, psnr)
assert abs(v["psnr_between"] - psnr["held_out"]) <= 1 / 512, (v, psnr)
assert report["bytes"]["volume"] == 50
E
verdict encoded

# ---- predicted: large pictures and few primitives make iterations that count
"$saga" synth row --size 320x180 --samples 1 --cameras 5 --hold-out 0 \
    --frames 1 --depth-every 0 >out 2>err || complain "synth: $(cat err)"
few=(encode row -o p.saga --primitives 30 --device cpu --quiet)
"$saga" "${few[@]}" --iterations 100 >out 2>err || complain "$(cat err)"
shows 'no camera was held out, and so short a training predicts nothing'
holds p.saga 'v["psnr_between"] is None'
rm p.saga
"$saga" "${few[@]}" --iterations 1000 --json >p.json 2>err ||
    complain "$(cat err)"
python3 - "$saga" <<'E' || complain "not the PSNR that is predicted"
import json, subprocess, sys
report = json.load(open("p.json"))
v = json.loads(subprocess.check_output([sys.argv[1], "volume", "p.saga",
                                        "--json"]))["volume"]
between, psnr = report["psnr_between"], report["psnr"]
assert not between["measured"] and between["n_left_out"] >= 1, between
assert between["expected"] == between["predicted"] <= psnr["training"], between
assert abs(v["psnr_between"] - between["predicted"]) <= 1 / 512, (v, between)
gap = psnr["training"] - between["predicted"]
word = "good" if gap <= 1 else "soft" if gap <= 3 else "poor"
assert report["between_cameras"] == word, report["between_cameras"]
E
verdict predicted

# ---- bad
told 2 '400 is not within 0 and 180' a.saga --azimuth 400 -o x.saga
told 2 'give both ends of the range in order' a.saga --nearest 200 -o x.saga
told 2 'give both ends of the range in order' a.saga --lowest 80 -o x.saga
told 2 'a change needs -o OUT' a.saga --find
told 2 'leave the other options out' a.saga --none --find -o x.saga
told 2 'give what to change' a.saga -o x.saga
told 2 'has no camera 99' a.saga --start 99 -o x.saga
head -c 300 a.saga >cut.saga
told 1 'cut.saga' cut.saga --find -o x.saga
[ ! -e x.saga ] || complain "a file was written"
python3 - <<'E'
a, b = (bytearray(open(f"{n}.saga", "rb").read()) for n in "ab")
at = next(i for i in range(len(a)) if a[i] != b[i])
a[at] ^= 1
open("harmed.saga", "wb").write(a)
E
told 1 'harmed.saga: its viewing volume is damaged' harmed.saga
told 1 'its viewing volume is damaged' harmed.saga --turn 5 -o x.saga
[ ! -e x.saga ] || complain "a file was written for a damaged one"
verdict bad
exit "$failed"
