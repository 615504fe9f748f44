#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_cli.sh: guarantees, for the program `saga` (build/saga, or SAGA=...),
#   help        every command has a help; --version works; a command line
#               without a command is an error
#   usage       wrong command lines end with status 2, nothing on stdout and
#               one line on stderr that names what is wrong
#   quiet       every command that shows progress on a terminal shows none with
#               --quiet
#   good        `saga info` reports every good vector as text and as valid JSON;
#               both agree with `saga-dec --info`, and the bytes of the file's
#               parts add up to its size
#   bad         for every bad vector whose header or chunks are damaged,
#               `saga info` ends with status 1 and one line that names the file
#   render      pictures have the pixels of saga-dec, at any time and size, as
#               sequences and along paths; if a picture cannot be drawn or
#               written, that is reported and no incomplete file remains
#   verify      a file is reported as text and JSON; a file without a picture is
#               refused
#   outputs     saga and saga-dec write to devices and pipes without replacing
#               them, leave other files alone, obey umask, remove the temporary
#               files of killed runs, and report a write error on stdout
#   synth       a capture appears either completely or not at all
#   names       cameras whose names are not valid UTF-8 are in every report; a
#               string that JSON cannot represent is an error
#   check       a camera that is darker than the others, and a missing picture,
#               are reported as text and on a page that needs no other file;
#               poses in another convention are recognised, and --fix writes
#               correct ones; a folder that is not a capture is refused
#   eval        a capture of the file's own pictures is found equal to the file;
#               a known error has its PSNR; a capture that does not fit the file
#               is refused
set -u
cd "$(dirname "$0")/../.." || exit

build=${BUILD:-build}
saga=${SAGA:-$build/saga}
saga_dec=${SAGA_DEC:-$build/saga-dec}
if [ ! -x "$saga" ] || [ ! -x "$saga_dec" ]; then
    "${MAKE:-make}" -s BUILD="$build" "$saga" "$saga_dec" ||
        { echo "FAIL cli: $saga cannot be built"; exit 1; }
fi

checks=cli
. tests/cli/verdict.sh

run_as=("$saga")

# ---- help
expect 0 --help
awk 'length > 79 { print "--help: " length " columns" }' "$tmp/out" \
    >>"$tmp/bad"
for c in $(sed -n 's/^  \([a-z][a-z]*\)  .*/\1/p' "$tmp/out"); do
    expect 0 help "$c"
    grep -q "^usage: saga $c " "$tmp/out" || complain "help $c: no usage"
    cp "$tmp/out" "$tmp/help"
    expect 0 "$c" --help
    cmp -s "$tmp/out" "$tmp/help" || complain "$c --help is not help $c"
    expect 0 help "$c" --all
    cp "$tmp/out" "$tmp/help"
    expect 0 "$c" --help --all
    cmp -s "$tmp/out" "$tmp/help" || complain "$c --help --all is another"
    awk -v c="$c" 'length > 79 { print "help " c ": " length " columns" }' \
        "$tmp/out" >>"$tmp/bad"
done
grep -q . "$tmp/help" || complain "--help lists no command"
# The help of encode has the 25 options that people use, and with --all each.
expect 0 help encode
[ "$(grep -c '^  -' "$tmp/out")" = 25 ] &&
    tail -n 1 "$tmp/out" | grep -q '^`saga help encode --all` lists 18 more' &&
    ! grep -q '^  --ablate' "$tmp/out" || complain "help encode: $(cat "$tmp/out")"
expect 0 help encode --all
[ "$(grep -c '^  -' "$tmp/out")" = 43 ] && grep -q '^  --ablate' "$tmp/out" ||
    complain "help encode --all: $(cat "$tmp/out")"
# The README's table of layouts must have what the help has from the loaders.
"$saga" help check | awk '
    /^A capture is a folder/ { on = 1 }
    on && /^  [^ ]/ { if (row) print row; row = substr($0, 3)
                      sub(/   */, " | ", row); next }
    on && row && /^      / { sub(/^ */, ""); row = row " " $0; next }
    row { print row; exit }' >"$tmp/layouts"
sed -n '/^| layout /,/^$/s/^| \(.*\) |$/\1/p' README.md |
    sed '1d; s/`//g' >"$tmp/readme"
grep -q '^COLMAP | images/' "$tmp/layouts" ||
    complain "help check lists no layouts"
diff "$tmp/layouts" "$tmp/readme" >>"$tmp/bad" || :
# docs/presets.md must have what `saga help presets` prints.
expect 0 help presets
sed 's/^\(.\)/    \1/' "$tmp/out" >"$tmp/presets"
awk '/^    / { on = 1 } /^[^ ]/ { if (on) exit } on' docs/presets.md |
    sed -e :a -e '/^\n*$/{$d;N;ba' -e '}' >"$tmp/page"
diff "$tmp/presets" "$tmp/page" >>"$tmp/bad" || :
expect 0 --version
grep -Eq '^saga [0-9.]+, format 1\.0$' "$tmp/out" ||
    complain "--version says $(cat "$tmp/out")"
version=$(sed -n 's/^saga \([0-9.]*\),.*/\1/p' "$tmp/out")
"$saga_dec" --version >"$tmp/out" 2>&1
grep -q "^saga-dec $version, format 1\.0, level [0-3]$" "$tmp/out" ||
    complain "saga-dec --version says $(cat "$tmp/out")"
verdict help

# ---- usage
good=vectors/good/segments.saga
told 2 'saga --help'
# Names from the command line reach the terminal without escape sequences.
escape=$(printf 'a\033[31mb')
for program in "$saga_dec" "$(dirname "$saga_dec")/saga-play"; do
    [ -x "$program" ] || continue
    "$program" "$escape" "$escape" 2>&1 | grep -q 'a%1B\[31mb' ||
        complain "$program does not show a%1B[31mb"
done
told 2 "did you mean 'info'" inf "$good"
told 2 "unknown command 'zzz'" zzz
told 2 "unknown command 'zzz'" help zzz
told 2 'an argument is missing' info
told 2 'too many arguments' info "$good" "$good"
told 2 "did you mean '--json'" info "$good" --jsn
told 2 '--json takes no value' info "$good" --json=1
told 2 "$tmp/none.saga: cannot be opened" info "$tmp/none.saga"
told 2 "$tmp: is not a regular file" info "$tmp"
expect 2 info http://example.org/x.saga
says 'http://example.org/x.saga: is an address, not a file on this machine; '
told 2 '--json: cannot be opened' info -- --json
if [ -e /dev/full ]; then
    "$saga" info "$good" >/dev/full 2>"$tmp/err"
    [ $? = 2 ] || complain "a full disk is not status 2"
    grep -q 'standard output' "$tmp/err" || complain "a full disk: no message"
fi
verdict usage

# ---- quiet
cat >"$tmp/quiet.py" <<'PYTHON'
import os, pty, shlex, shutil, subprocess, sys

saga, still, tmp = sys.argv[1:]


def shown(command):
    """What the program writes to a terminal on stderr."""
    terminal, end = pty.openpty()
    shutil.rmtree(tmp + "/made", ignore_errors=True)
    if subprocess.call([saga, *command], stderr=end, cwd=tmp,
                       stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL):
        print(*command, "fails")
    os.write(end, b"*")
    return os.read(terminal, 1 << 20)


for line in f"""
synth made --size 48x32 --cameras 3 --frames 2 --hold-out 1 -> filmed
check filmed
encode filmed -o made --iterations 12 --primitives 64 -> filmed.saga
eval filmed.saga filmed --no-ssim
verify {still}
export {still} -o made/%d.ply -> plys
import plys/0.ply -o made --iterations 4 --size 16x16 -> plys.saga
render {still} --orbit 3 --size 16x16 -o %d.png
""".strip().split("\n"):
    line, _, kept = line.partition(" -> ")
    command = shlex.split(line)
    if b" %  " not in shown(command):
        print(line, "shows no progress")
    if os.path.isfile(tmp + "/made"):
        os.remove(tmp + "/made")
    if b" %  " in shown([*command, "--quiet"]):
        print(line, "--quiet shows progress")
    if kept:
        os.rename(tmp + "/made", tmp + "/" + kept)
PYTHON
mkdir "$tmp/quiet"
python3 "$tmp/quiet.py" "$(realpath "$saga")" "$PWD/vectors/good/still.saga" \
    "$tmp/quiet" >>"$bad" 2>&1 || complain "quiet.py fails"
verdict quiet

# ---- good
cat >"$tmp/agree.py" <<'PYTHON'
import json, os, subprocess, sys

sys.path.insert(0, "tests/stream")
import film

saga, saga_dec, *files = sys.argv[1:]


def said_by(*command):
    done = subprocess.run(command, text=True, capture_output=True)
    if done.returncode or done.stderr:
        print(*command, "has status", done.returncode, done.stderr)
    return done.stdout


def classes_of(name):
    """The classes of a file, by the tables of bitstream.md."""
    f = film.Film(*os.path.split(name))
    n = f.get("classes.n_classes") if "classes.n_classes" in f.fields else 0
    for c in range(n):
        first, n_features, one = (f.get(f"classes.class_{c}.{k}")
                                  for k in ("first", "n", "one"))
        yield {"first": first, "n_features": n_features,
               "one": one if one < f.get("header.features") else None}


def text_of(c):
    """The line of `saga info` about a class."""
    return "            %d feature%s from %d on%s\n" % (
        c["n_features"], "s" * (c["n_features"] != 1), c["first"],
        "" if c["one"] is None else ", and feature %d, which is 1" % c["one"])


def complaints(j, said):
    d = j["decoding"]
    for what in [
        "version     %d, level %d\n" % (j["version"], j["level"]),
        "segments    %d, frames %d at %d/%d per second\n"
        % (j["n_segments"], j["n_frames"], *j["frames_per_second"]),
        "cameras     %d\n" % len(j["rig"]),
        "at most     %d coarse, %d fine anchors, %d primitives a segment\n"
        % (d["max_coarse"], d["max_fine"], d["max_primitives"]),
        "networks    %d weights in %d bytes\n"
        % (d["n_weights"], j["bytes"]["networks"]),
        "memory      %d bytes\n" % d["memory_nbytes"],
        "decoding    %d multiply-accumulates a segment, %d a primitive"
        % (d["macs_per_segment"], d["macs_per_primitive_and_view"]),
    ]:
        if what not in said:
            yield "saga-dec --info does not say: " + what.strip()
    s = j["segments"]
    for what, a, b in [
        ("bytes", sum(j["bytes"].values()), j["nbytes"]),
        ("segments", len(s), j["n_segments"]),
        ("frames", sum(x["n_frames"] for x in s), j["n_frames"]),
        ("chunks", j["crc"]["chunks_checked"], 2 +
         sum(1 + 3 * len(x["layers"]) for x in s) +
         3 * (j["bytes"]["base"] > 0) +
         sum(j["bytes"][kind] > 0
             for kind in ("names", "exposures", "sound", "volume"))),
        ("other bytes", j["bytes"]["other"], 0),
        ("layers", {len(x["layers"]) for x in s}, {d["n_layers"]}),
        ("most primitives", max(x["n_primitives"] for x in s)
         <= d["max_primitives"], True),
        ("sound", j["crc"]["sound"], True),
        ("classes", j["classes"], list(classes_of(j["file"]))),
    ]:
        if a != b:
            yield "%s %s != %s" % (what, a, b)


for f in files:
    told = said_by(saga, "info", f)
    if "chunks are right" not in told:
        print(f + ": no word of CRCs")
    if "".join(map(text_of, classes_of(f))) not in told:
        print(f + ": other classes")
    try:
        for what in complaints(json.loads(said_by(saga, "info", f, "--json")),
                               said_by(saga_dec, f, "--info")):
            print(f + ":", what)
    except (LookupError, ValueError) as e:
        print("%s: not the JSON of a file: %r" % (f, e))
PYTHON
files=(vectors/good/*.saga)
n=${#files[@]}
python3 "$tmp/agree.py" "$saga" "$saga_dec" "${files[@]}" >>"$bad" 2>&1
[ "$n" -ge 5 ] || complain "only $n good vectors"
verdict "good: $n files"

# ---- bad
n=0
for f in vectors/bad/*.saga; do
    n=$((n + 1))
    "$saga" info "$f" >"$tmp/out" 2>"$tmp/err"
    rc=$?
    mapfile -t says <"$tmp/err"
    case ${f##*/} in
    crc_* | cut_* | magic* | version* | empty*) refused=1 ;;
    *)
        refused=0
        "$saga_dec" "$f" --info >/dev/null 2>&1 || refused=1
        ;;
    esac
    # A stream whose chunks are intact may still be invalid, which only decoding
    # finds.
    [ "$rc" = "$refused" ] || { [ "$rc" = 1 ] && [ "$refused" = 0 ]; } ||
        complain "$f: status $rc"
    [ "$rc" = 0 ] || [[ ${says[*]} == *"saga: $f: "* ]] ||
        complain "$f: the message does not name it: ${says[*]}"
    [ "$rc" = 0 ] || [ ${#says[@]} = 1 ] ||
        complain "$f: not one line of message"
done
# saga-dec must report for each bad vector the status that MANIFEST has,
# whichever function finds it.
while read -r f what status; do
    [ "$what" = status ] || continue
    case $status in
    -10) said='not a valid stream' ;;
    -11) said='ends too early' ;;
    -12) said='needs a newer decoder' ;;
    *) said='exceeds its level' ;;
    esac
    "$saga_dec" "vectors/$f" --camera rig:0 --crc >"$tmp/out" 2>"$tmp/err"
    rc=$?
    mapfile -t says <"$tmp/err"
    { [ $rc = 1 ] && [ ! -s "$tmp/out" ] && [[ ${says[*]} == *"$said"* ]]; } ||
        complain "saga-dec $f: status $rc, no '$said': ${says[*]}"
done <vectors/MANIFEST
[ "$n" -ge 20 ] || complain "only $n bad vectors"
# A file that is no .saga file must be reported as such.
told 1 'not a .saga file' info tests/cli/check_cli.sh
# A stream of version 0 is damaged, because no saga writes it; one of version
# 256 needs a newer saga.
told 1 'it is damaged, copy it again' info vectors/bad/version_zero.saga
told 1 'it needs a newer saga' info vectors/bad/version_256.saga
# If a byte at the end of a segment has changed, the message must name the
# segment, and the report must still have the other segments.
cp "$good" "$tmp/flip.saga"
printf 'X' | dd of="$tmp/flip.saga" bs=1 conv=notrunc status=none \
    seek=$(($(wc -c <"$good") - 1))
expect 1 info "$tmp/flip.saga" --json
python3 -c 'import json, sys
j = json.load(open(sys.argv[1]))
assert not j["crc"]["sound"] and j["crc"]["segments_damaged"] == 1
assert [s["damaged"] for s in j["segments"]] == [False, False, True]
assert sum(j["bytes"].values()) == j["nbytes"]' "$tmp/out" 2>"$tmp/py" ||
    complain "a flipped byte: $(tail -n 1 "$tmp/py")"
grep -q 'CRC' "$tmp/err" || complain "a flipped byte: $(cat "$tmp/err")"
# In this stream, the checksum of each chunk begins anew, as it did before format
# 1.0.
python3 -c '
import sys
b = bytearray(open(sys.argv[1], "rb").read())
at = int.from_bytes(b[8:12], "little")
n = int.from_bytes(b[at + 4:at + 8], "little")
crc = 0xffffffff
for x in b[at:at + 8] + b[at + 12:at + 12 + n]:
    crc ^= x
    for _ in range(8):
        crc = crc >> 1 ^ (0x82f63b78 if crc & 1 else 0)
b[at + 8:at + 12] = (crc ^ 0xffffffff).to_bytes(4, "little")
open(sys.argv[2], "wb").write(b)' "$good" "$tmp/early.saga"
expect 1 info "$tmp/early.saga"
says 'a program from before format 1.0 has written it: encode it again'
verdict "bad: $n files"

# ---- render
take() { # take FILE: the film of what follows, and its frames
    scene=$1
    frames=$("$saga" info "$scene" --json |
             python3 -c 'import json, sys; print(json.load(sys.stdin)["n_frames"])')
    last=$(printf %05d $((frames - 1)))
    middle=$(printf %05d $((frames / 2)))
}
take vectors/good/motion.saga
# same PNG PPM: checks that both have the same size and pixels.
cat >"$tmp/same.py" <<'PYTHON'
import struct, sys, zlib

png, ppm = (open(p, "rb").read() for p in sys.argv[1:3])
at, packed = 8, b""
while at < len(png):
    n, kind = struct.unpack(">I4s", png[at:at + 8])
    if kind == b"IHDR":
        w, h = struct.unpack(">II", png[at + 8:at + 16])
    if kind == b"IDAT":
        packed += png[at + 8:at + 8 + n]
    at += 12 + n
raw, out, up = zlib.decompress(packed), bytearray(), bytes(3 * w)
for y in range(h):
    row = bytearray(raw[y * (3 * w + 1) + 1:(y + 1) * (3 * w + 1)])
    kind = raw[y * (3 * w + 1)]
    for x in range(3 * w):
        a, b, c = (row[x - 3], up[x], up[x - 3]) if x > 2 else (0, up[x], 0)
        p = min((abs(b - c), 0, a), (abs(a - c), 1, b),
                (abs(a + b - 2 * c), 2, c))[2]
        row[x] = row[x] + [0, a, b, (a + b) // 2, p][kind] & 255
    out += row
    up = row
assert ppm == b"P6\n%d %d\n255\n" % (w, h) + out, "other pixels"
PYTHON
for n in 0 1 2; do
    expect 0 render "$scene" -o "$tmp/one.png" --camera $n --frame 15/2
    "$saga_dec" "$scene" --camera $n --time 15/2 -o "$tmp/one.ppm" ||
        complain "saga-dec fails"
    expect 0 render "$scene" -o "$tmp/rig.png" --camera rig:$n --frame 15/2
    cmp -s "$tmp/one.png" "$tmp/rig.png" || complain "rig:$n is not camera $n"
    python3 "$tmp/same.py" "$tmp/one.png" "$tmp/one.ppm" 2>"$tmp/py" ||
        complain "camera $n is not saga-dec's: $(tail -n 1 "$tmp/py")"
done
"$saga_dec" "$scene" --camera rig:0 --crc --seconds 600 >"$tmp/out" 2>&1 ||
    complain "saga-dec --seconds 600: $(cat "$tmp/out")"
"$saga_dec" "$scene" --camera rig:0 --crc --seconds 1e-9 >"$tmp/out" 2>&1
[ $? = 1 ] && grep -q "took more than 1e-09 s; allow more with" "$tmp/out" ||
    complain "saga-dec --seconds 1e-9: $(cat "$tmp/out")"
expect 0 render "$scene" -o "$tmp/two.png" --camera=2 --time 0.25 --threads 3
cmp -s "$tmp/one.png" "$tmp/two.png" || complain "--time 0.25 is not 15/2"
mkdir "$tmp/seq"
expect 0 render "$scene" -o "$tmp/seq/a%03d.png" \
    --frames $((frames - 2)):"$frames"
expect 0 render "$scene" -o "$tmp/seq/b%d.exr" --orbit 3 --size 64x32
[ "$(ls "$tmp/seq" | tr '\n' ' ')" = \
    "$(printf 'a%03d.png ' $((frames - 2)) $((frames - 1)))b0.exr b1.exr b2.exr " ] ||
    complain "a sequence makes $(ls "$tmp/seq")"
rm -f "$tmp"/*.p?m "$tmp"/*.png
# The picture takes 28 MB for its pixels and 64 MB to be drawn in bands; drawing
# it at once would take 160 MB, which exceed the limit.
(ulimit -c 0 -v 140000
 "$saga" render "$scene" -o "$tmp/big.png" --size 3072x3072 --threads 1 \
     >"$tmp/out" 2>"$tmp/err") || complain "bands: $(cat "$tmp/err")"
rm -f "$tmp/big.png"
# The pixels alone take 805 MB.
(ulimit -c 0 -v 500000
 "$saga" render "$scene" -o "$tmp/big.png" --size 16384x16384 \
     >"$tmp/out" 2>"$tmp/err")
says 'render: the picture: out of memory, 805306368 bytes wanted'
(ulimit -c 0 -v 60000
 "$saga" render "$scene" -o "$tmp/big.png" --size 3072x3072 --threads 1 \
     >"$tmp/out" 2>"$tmp/err")
says 'render: drawing: out of memory, '
for command in "render $scene -o $tmp/big.png" "synth $tmp/big.png" \
    "encode $tmp -o $tmp/big.png" "eval $scene $tmp"; do
    # shellcheck disable=SC2086
    (ulimit -c 0 -v 200000
     "$saga" $command --threads 500 >"$tmp/out" 2>"$tmp/err")
    says '500 threads: out of memory, 1048576000 bytes wanted; take fewer'
done
[ ! -e "$tmp/big.png" ] || complain "a picture without memory"
told 2 '-o OUT is missing' render "$scene"
told 2 '.png or .exr' render "$scene" -o "$tmp/x.jpg"
told 2 'one number in the name' render "$scene" -o "$tmp/x.png" --orbit 3
for name in "$tmp/%s%d.png" "$tmp/%d%d.png" "$tmp/%99d.png" "$tmp/%n.png"; do
    told 2 'one number in the name' render "$scene" -o "$name" --orbit 3
done
told 2 'exclude each other' render "$scene" -o "$tmp/x.png" --time 1 --frame 2
for size in 0x5 0 5x 16385 x5 5y; do
    told 2 '--size takes WxH|N, 1 to 16384' render "$scene" -o "$tmp/x.png" \
        --size $size
done
told 2 '--time takes SECONDS' render "$scene" -o "$tmp/x.png" --time -1
told 2 "$tmp/none/x.png: cannot be created" render "$scene" -o "$tmp/none/x.png"
expect 1 render "$scene" -o "$tmp/x.png" --frame "$frames"
says "no frame $frames among its $frames"
expect 1 render "$scene" -o "$tmp/x%d.png" --frames 0:$((frames + 1))
says "--frames 0:$((frames + 1)) goes beyond its $frames frames"
told 1 'no camera 3; it has 3 cameras' render "$scene" -o "$tmp/x.png" --camera 3
expect 1 render vectors/bad/crc_segment.saga -o "$tmp/x.png"
says 'segment 0 is refused'
says 'saga info'
told 1 'header is refused' render vectors/bad/crc_header.saga -o "$tmp/x.png"
# These streams are undamaged, but not valid, as a file from before format 1.0
# is.
for f in scale_below_zero more_than_maximum; do
    expect 1 render vectors/bad/$f.saga -o "$tmp/x.png"
    says 'from before format 1.0: encode it again'
done
named=vectors/good/names.saga
named_n=0
cam=$'c\xc3\xa1m'
for c in 1 "$cam 9"; do
    expect 0 render $named -o "$tmp/n.png" --camera "$c" --frame 0
    mv "$tmp/n.png" "$tmp/n$((++named_n))"
done
cmp -s "$tmp/n1" "$tmp/n2" || complain "--camera: a name is not its number"
expect 1 render $named -o "$tmp/x.png" --camera "$cam"
says "no camera $cam; it has 3 cameras"
expect 0 info $named
grep -q "$cam 9" "$tmp/out" && grep -q ': 0.1875 m' "$tmp/out" ||
    complain "info: $(cat "$tmp/out")"
[ -z "$(find "$tmp" -name '*x*.png*')" ] || complain "something half-written"
verdict render

# ---- verify
expect 0 verify "$scene" --camera 1 --frame 15/2
for text in ' splats$' 'predicted feature' 'stopped otherwise'; do
    grep -q "$text" "$tmp/out" || complain "verify: no '$text'"
done
expect 0 verify docs/demo.saga --json --size 64x32
python3 -c '
import json, sys
v = json.load(open(sys.argv[1]))
assert (v["width"], v["height"]) == (64, 32)
assert v["rows"][0]["alone"]["n"] > 0
assert v["pictures_from"]["symbols"]["max"] <= 2' "$tmp/out" 2>"$tmp/py" ||
    complain "verify --json: $(tail -n 1 "$tmp/py")"
told 1 "lies past its $frames frames" verify "$scene" --frame "$frames"
told 1 'no camera 3; it has 3 cameras' verify "$scene" --camera 3
told 1 'crc_segment.saga' verify vectors/bad/crc_segment.saga
told 2 'verify' verify
verdict verify

# ---- outputs
# write_by PROGRAM OUT: one picture.
write_by() {
    if [ "$1" = saga ]; then
        "$saga" render "$scene" -o "$2" >"$tmp/out" 2>"$tmp/err"
    else
        "$saga_dec" "$scene" --camera rig:0 -o "$2" >"$tmp/out" 2>"$tmp/err"
    fi
}
for by in saga saga_dec; do
    mkdir "$tmp/to"
    ln -s /dev/null "$tmp/to/null.png"
    write_by $by "$tmp/to/null.png" || complain "$by: null: $(cat "$tmp/err")"
    [ -L "$tmp/to/null.png" ] || complain "$by: a link to a device is a file"
    mkfifo "$tmp/to/fifo.png"
    cat "$tmp/to/fifo.png" >"$tmp/piped" &
    write_by $by "$tmp/to/fifo.png" || complain "$by: fifo: $(cat "$tmp/err")"
    [ -p "$tmp/to/fifo.png" ] && wait || complain "$by: a pipe is a file"
    kill $! 2>/dev/null && wait
    rm -f "$tmp/to/"*
    echo mine >"$tmp/to/a.png.part"
    echo half >"$tmp/to/a.png.saga-part-1-0"
    (umask 077; write_by $by "$tmp/to/a.png") || complain "$by: umask"
    [ "$(stat -c %a "$tmp/to/a.png")" = 600 ] || complain "$by: umask ignored"
    [ "$(cat "$tmp/to/a.png.part")" = mine ] || complain "$by: a.png.part"
    [ "$(ls "$tmp/to" | tr '\n' ' ')" = "a.png a.png.part " ] ||
        complain "$by leaves $(ls "$tmp/to")"
    cmp -s "$tmp/to/a.png" "$tmp/piped" || complain "$by: other bytes in a pipe"
    rm -r "$tmp/to"
done
mkfifo "$tmp/fifo"
for by in "$saga info" "$saga_dec --info"; do
    timeout 10 $by "$tmp/fifo" >"$tmp/out" 2>"$tmp/err"
    [ $? = 2 ] || complain "$by: a pipe as input"
    says 'is not a regular file'
done
if [ -e /dev/full ]; then
    for what in --info '--camera rig:0 --crc'; do
        # shellcheck disable=SC2086
        "$saga_dec" "$scene" $what >/dev/full 2>"$tmp/err"
        [ $? = 2 ] || complain "saga-dec $what: a full disk is not status 2"
        grep -q 'standard output' "$tmp/err" || complain "saga-dec: no message"
    done
fi
verdict outputs

# ---- synth
expect 0 synth "$tmp/syn" --size 48x32 --cameras 3 --hold-out 1 --frames 2 \
    --samples 1 --depth-every 0 --points 50
[ "$(find "$tmp/syn" -name '*.png' | wc -l)" = 6 ] ||
    complain "synth makes $(find "$tmp/syn" -name '*.png')"
python3 -m json.tool "$tmp/syn/transforms.json" >/dev/null ||
    complain "transforms.json is not JSON"
told 2 "$tmp/syn" synth "$tmp/syn"
expect 0 synth "$tmp/ring" --scene ring --size 48x32 --frames 1 --samples 1 \
    --depth-every 0 --points 50
[ "$(find "$tmp/ring" -name '*.png' | wc -l)" = 14 ] ||
    complain "synth --scene ring makes $(find "$tmp/ring" -name '*.png')"
expect 2 synth "$tmp/other" --scene rink
says 'there is no scene rink; use room or ring'
told 2 '--cameras takes N, 2 to 99' synth "$tmp/other" --cameras 1
told 2 "$tmp/none/other" synth "$tmp/none/other" --size 48x32
[ ! -e "$tmp/other" ] || complain "a folder of a refused synth"
verdict synth

# ---- names
cat >"$tmp/names.py" <<'PYTHON'
import json, os, shutil, sys

# Write a picture of each camera as a COLMAP model. In one name, the first byte
# of e-acute in UTF-8 is at the last place that a name can have.
cap, to = sys.argv[1], os.fsencode(sys.argv[2])
names = [b"caf\xe9", b"caf\xe8", b"x" * 62 + "\u00e9".encode(), b"plain"]
j = json.load(open(cap + "/transforms.json"))
first = [f for f in j["frames"] if f["file_path"].endswith("00000.png")]
os.makedirs(to + b"/sparse/0")
os.mkdir(to + b"/images")
images = b""
for i, (f, name) in enumerate(zip(first, names)):
    m = f["transform_matrix"]
    r = [[s * m[k][a] for k in range(3)] for a, s in ((0, 1), (1, -1), (2, -1))]
    t = [-sum(r[a][k] * m[k][3] for k in range(3)) for a in range(3)]
    w = (1 + r[0][0] + r[1][1] + r[2][2]) ** 0.5 / 2
    q = (w, (r[2][1] - r[1][2]) / (4 * w), (r[0][2] - r[2][0]) / (4 * w),
         (r[1][0] - r[0][1]) / (4 * w))
    images += b"%d %s 1 %s.png\n\n" % (
        i + 1, " ".join(map(repr, [*q, *t])).encode(), name)
    shutil.copy(cap + "/" + f["file_path"], to + b"/images/" + name + b".png")
open(to + b"/sparse/0/images.txt", "wb").write(images)
open(to + b"/sparse/0/cameras.txt", "w").write(
    "1 PINHOLE %d %d %r %r %r %r\n" % tuple(
        j[k] for k in ("w", "h", "fl_x", "fl_y", "cx", "cy")))
open(to + b"/sparse/0/points3D.txt", "w").write("".join(
    "%d %r %r 0.5 128 128 128 0.1\n" % (i, i % 7 * .3 - 1, i // 7 * .3 - 1)
    for i in range(49)))
PYTHON
expect 0 synth "$tmp/names" --size 48x32 --cameras 4 --hold-out 0 --frames 1 \
    --samples 1 --depth-every 0 --points 50
python3 "$tmp/names.py" "$tmp/names" "$tmp/odd" 2>"$tmp/py" ||
    complain "no capture: $(tail -n 1 "$tmp/py")"
latin=$'caf\xe9'
expect 0 encode "$tmp/odd" -o "$tmp/odd.saga" --primitives 20 --iterations 6 \
    --hold-out caf%E9 --json
mv "$tmp/out" "$tmp/encode.json"
expect 0 eval "$tmp/odd.saga" "$tmp/odd" --no-ssim --hold-out "$latin" --json
mv "$tmp/out" "$tmp/eval.json"
expect 0 info "$tmp/odd.saga" --json
mv "$tmp/out" "$tmp/info.json"
expect 0 check "$tmp/odd" --json
python3 -c '
import json, sys
names = ["caf%E8", "caf%E9", "plain", "x" * 62]
e, v, i, c = [json.load(open(n)) for n in sys.argv[1:]]
assert sorted(e["exposure"]) == names, e["exposure"]
assert e["psnr"]["n_held_out"] == 1 and e["options"]["hold_out"] == "caf%E9"
assert sorted(w["name"] for w in v["views"]) == names, v["views"]
assert [w["name"] for w in v["views"] if w["held_out"]] == ["caf%E9"]
assert sorted(w["name"] for w in i["rig"]) == names, i["rig"]
assert sorted(w["name"] for w in c["views"]) == names, c["views"]
' "$tmp/encode.json" "$tmp/eval.json" "$tmp/info.json" "$tmp/out" \
    2>"$tmp/py" || complain "names that are no UTF-8: $(tail -n 1 "$tmp/py")"
# No camera may be left out of a file in which a name is not UTF-8.
python3 -c '
import sys
b = bytearray(open(sys.argv[1], "rb").read())
def crc_of(crc, data):
    crc ^= 0xffffffff
    for x in data:
        crc ^= x
        for _ in range(8):
            crc = crc >> 1 ^ (0x82f63b78 if crc & 1 else 0)
    return crc ^ 0xffffffff
at, nets = b.index(b"NAME"), b.index(b"NETS")
n = int.from_bytes(b[at + 4:at + 8], "little")
assert b[at + 22:at + 24] == b"c\xc3"
b[at + 23] = 0x61
before = int.from_bytes(b[nets + 8:nets + 12], "little")
crc = crc_of(before, b[at:at + 8] + b[at + 12:at + 12 + n])
b[at + 8:at + 12] = crc.to_bytes(4, "little")
open(sys.argv[2], "wb").write(b)' vectors/good/names.saga "$tmp/foreign.saga" \
    2>"$tmp/py" || complain "no foreign file: $(tail -n 1 "$tmp/py")"
expect 0 info "$tmp/foreign.saga" --json
python3 -c '
import json, sys
assert len(json.load(open(sys.argv[1]))["rig"]) == 3' "$tmp/out" \
    2>"$tmp/py" || complain "info of a name that is no UTF-8 lacks cameras"
# A name that JSON cannot hold must be an error, before the work starts if it is
# known by then.
mv "$tmp/odd" "$tmp/$latin"
expect 2 encode "$tmp/$latin" -o "$tmp/new.saga" --primitives 20 \
    --iterations 6 --json
says 'is not UTF-8 and cannot be written as JSON; rename it'
told 2 'is not UTF-8 and cannot be written as JSON' \
    eval "$tmp/odd.saga" "$tmp/$latin" --json
mv "$tmp/$latin" "$tmp/odd"
expect 2 eval "$tmp/odd.saga" "$tmp/odd" --no-ssim --json \
    --pictures "$tmp/$latin"
says 'has a report that JSON cannot hold; '
verdict names

# ---- check
# Half of the light in cam02; the camera with an umlaut lacks its second frame.
umlaut=$'cam<b>\303\274'
expect 0 synth "$tmp/dim" --size 96x54 --cameras 4 --hold-out 0 --frames 2 \
    --samples 1 --depth-every 0 --points 600
for p in "$tmp"/dim/images/cam02/*.png; do
    ffmpeg -nostdin -v error -y -i "$p" -vf lutrgb=r=val*.73:g=val*.73:b=val*.73 \
        "$tmp/dim.png" && mv "$tmp/dim.png" "$p"
done
mv "$tmp/dim/images/cam01" "$tmp/dim/images/$umlaut"
sed -i "s/cam01/$umlaut/" "$tmp/dim/transforms.json"
rm "$tmp/dim/images/$umlaut/00001.png"
expect 0 check "$tmp/dim" --html "$tmp/dim.html"
for text in 'cam02 is 1.0' 'stops darker' '--preset fast' \
    "$umlaut lacks 1 of 2 pictures"; do
    grep -qF -e "$text" "$tmp/out" || complain "check: no '$text'"
done
python3 - "$tmp/dim.html" >>"$tmp/bad" 2>&1 <<'PYTHON'
import base64, html.parser, re, sys

text = open(sys.argv[1], encoding="utf-8").read()
pictures = re.findall("src='data:image/jpeg;base64,([^']*)'", text)
if len(pictures) != 4 or text.count("src=") != 4 or "href" in text:
    print("check --html: not four pictures of its own")
if not all(base64.b64decode(p)[:2] == b"\xff\xd8" for p in pictures):
    print("check --html: no JPEG")
if "<b>" in text or "cam&#60;b&#62;" not in text or "1.0" not in text:
    print("check --html: a name is not escaped, or missing")
if "<li>Pictures are missing: cam&#60;b&#62;\u00fc lacks 1 of 2" not in text:
    print("check --html: a note is not as it is in the text")
PYTHON
# The plan is the view from above, with the cameras from left to right as they
# see each other, whatever the axes: a world with z, x, y instead has the same.
mkdir "$tmp/turned"
mv "$tmp/dim/images" "$tmp/turned/images"
python3 - "$tmp/dim/transforms.json" >"$tmp/turned/transforms.json" <<'PYTHON'
import json, sys

scene = json.load(open(sys.argv[1]))
del scene["ply_file_path"]
for frame in scene["frames"]:
    x, y, z, one = frame["transform_matrix"]
    frame["transform_matrix"] = [z, x, y, one]
json.dump(scene, sys.stdout)
PYTHON
expect 0 check "$tmp/turned" --html "$tmp/turned.html"
python3 - "$tmp/dim.html" "$tmp/turned.html" >>"$tmp/bad" 2>&1 <<'PYTHON'
import re, sys

plans = [[tuple(map(float, at)) for at in re.findall(
    "cx=([0-9.]+) cy=([0-9.]+) r=3", open(name, encoding="utf-8").read())]
    for name in sys.argv[1:]]
if len(plans[0]) != 4 or plans[0] != sorted(plans[0]):
    print("check --html: cameras stand at", plans[0])
if any(abs(a - b) > 0.11 for one, two in zip(*plans)
       for a, b in zip(one, two)):
    print("check --html: other axes give another plan", plans)
PYTHON
mv "$tmp/turned/images" "$tmp/dim/images"
# 24 frames must be one segment, although they are two minutes long; 48 must be
# two.
expect 0 synth "$tmp/long" --size 32x18 --cameras 3 --hold-out 0 --frames 48 \
    --fps 0.2 --samples 1 --depth-every 0 --points 100
for span in 0:24 0:48; do
    expect 0 check "$tmp/long" --frames $span --json
    mv "$tmp/out" "$tmp/forecast$span"
done
python3 - "$tmp"/forecast* >>"$tmp/bad" 2>&1 <<'PYTHON'
import json, sys

one, two = (json.load(open(name))["forecast"][0] for name in sys.argv[1:])
for f, n in (one, 1), (two, 2):
    if f["n_segments"] != n or abs(
            1.25 * f["least_kb"] - 2.8 - 3 * 0.09 -
            0.01285 * n * f["n_primitives"]) > 1e-6 or (
            f["picture_nbytes"] != 24 * 3 * 32 * 18 * 3) or (
            f["pictures_in_file"]) or (
            f["memory_nbytes"] < f["picture_nbytes"]):
        print("check: the forecast of", n, "segments is", f)
PYTHON
expect 0 check "$tmp/long"
grep -q 'in 2 segments' "$tmp/out" || complain "check: no word of segments"
grep -q 'GB of disk' "$tmp/out" && complain "check: a file for few pictures"
expect 0 check "$tmp/long" --scratch "$tmp"
[ "$(grep -c '  decoded pictures of a segment take 0.0 GB of disk' \
    "$tmp/out")" = 3 ] || complain "check: no word of the scratch file"
# Sixteen photographs of 1200 x 750 must take longer than the preset fast has
# time for; at half their size they must not.
expect 0 synth "$tmp/wide" --size 40x25 --cameras 16 --hold-out 0 --frames 1 \
    --samples 1 --depth-every 0 --points 100
python3 - "$tmp/wide" >>"$tmp/bad" 2>&1 <<'PYTHON'
import glob, json, struct, sys, zlib

def chunk(kind, data):
    return (struct.pack(">I", len(data)) + kind + data +
            struct.pack(">I", zlib.crc32(kind + data)))

row = b"\0" + bytes(range(200)) * 18
png = (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(
    ">IIBBBBB", 1200, 750, 8, 2, 0, 0, 0)) +
    chunk(b"IDAT", zlib.compress(row * 750, 1)) + chunk(b"IEND", b""))
for name in glob.glob(sys.argv[1] + "/images/*/*.png"):
    open(name, "wb").write(png)
name = sys.argv[1] + "/transforms.json"
j = json.load(open(name))
for key in "w", "h", "fl_x", "fl_y", "cx", "cy":
    j[key] *= 30
json.dump(j, open(name, "w"))
PYTHON
expect 0 check "$tmp/wide"
[ "$(grep -A2 'preset fast' "$tmp/out" | tail -n 1)" = \
    '    with pictures reduced to 1/2 of their size, to save time' ] &&
    [ "$(grep -c 'of their size' "$tmp/out")" = 1 ] ||
    complain "check: the forecast of photographs: $(grep preset "$tmp/out")"
# Three cameras that are 24 degrees apart must be trained with teachers, except
# by the preset fast. Two teachers take half of the time in addition for a
# still, and two fifths for frames that may move.
for n_moments in 1 2; do
    expect 0 synth "$tmp/apart$n_moments" --size 40x25 --cameras 3 --hold-out 0 \
        --frames $n_moments --samples 1 --depth-every 0 --points 100
    expect 0 check "$tmp/apart$n_moments" --json
    mv "$tmp/out" "$tmp/teachers$n_moments"
done
python3 - "$tmp"/teachers1 "$tmp"/teachers2 >>"$tmp/bad" 2>&1 <<'PYTHON'
import json, sys

for name, part in zip(sys.argv[1:], (1 / 4, 1 / 5)):
    for f, n in zip(json.load(open(name))["forecast"], (0, 2, 2)):
        minutes = f["n_iterations"] / 12000 * (
            0.2705 * f["n_primitives"] / 1000 + 0.44 * 1000 / 100000)
        if (f["n_teachers"] != n or
                abs(f["cpu_minutes"] / minutes - 1 - part * n) > 1e-6):
            print("check: a forecast with", n, "teachers is", f)
PYTHON
# says_plan TEXT OPTIONS...: checks what encode prints before it trains.
says_plan() {
    local text=$1 pid i
    shift
    # Messages of the call before would seem to be those of this one, whose
    # shell, killed before it has become saga, removes $tmp.
    : >"$tmp/err"
    "$saga" encode "$tmp/wide" -o "$tmp/wide.saga" --preset fast "$@" \
        >"$tmp/out" 2>"$tmp/err" </dev/null &
    pid=$!
    for ((i = 0; i < 1000; i++)); do
        grep -q 'visits to each' "$tmp/err" && break
        sleep 0.01
    done
    kill -TERM $pid
    wait $pid
    rm -f "$tmp/wide.saga"*
    grep -q "$text" "$tmp/err" || complain "no '$text': $(cat "$tmp/err")"
}
says_plan 'pictures are reduced to 1/2 of their size, to fit the time of preset fast'
says_plan '480 iterations: preset fast, 30 visits' --scale 1
# A training that takes more memory than allowed must be refused before a picture
# is decoded.
picture=$(find "$tmp/wide" -name '*.png' | head -1)
cp "$picture" "$tmp/whole.png"
head -c 100 "$tmp/whole.png" >"$picture"
expect 2 encode "$tmp/wide" -o "$tmp/wide.saga" --scale 1 --level 3 \
    --primitives 400000 --memory 4
grep -q 'training 400000 primitives takes 5\.[0-9] GiB of memory, 0\.0 of' \
    "$tmp/err" && grep -q 'allows 4; give --memory 6, or fewer' "$tmp/err" ||
    complain "encode: no word of memory: $(cat "$tmp/err")"
cp "$tmp/whole.png" "$picture"
! grep -q 'of their size' "$tmp/err" || complain "--scale 1 is not obeyed"
# For one camera there must be no comparison with others, and for four frames no
# estimate of delays.
mkdir "$tmp/alone"
python3 - "$tmp/long" "$tmp/alone" >>"$tmp/bad" 2>&1 <<'PYTHON'
import json, os, sys

j = json.load(open(sys.argv[1] + "/transforms.json"))
j["frames"] = [f for f in j["frames"] if "cam00" in f["file_path"]]
for key in [k for k in j if k.endswith("_filenames")]:
    del j[key]
json.dump(j, open(sys.argv[2] + "/transforms.json", "w"))
for name in "images", "points.ply":
    os.symlink(os.path.join(sys.argv[1], name), os.path.join(sys.argv[2], name))
PYTHON
expect 0 check "$tmp/alone" --frames 0:4
grep -q ', 1 camera, 4 frames at' "$tmp/out" ||
    complain "check: one camera is $(head -n 1 "$tmp/out")"
grep -q 'One camera does not allow free views' "$tmp/out" ||
    complain "check: no word of one camera"
! grep -q '1 cameras\|180' "$tmp/out" ||
    complain "check: $(grep '1 cameras\|180' "$tmp/out")"
for name in long alone; do
    expect 0 check "$tmp/$name" --frames 0:4 --json
    python3 -c 'import json, sys
alone = sys.argv[1] == "alone"
j = json.load(sys.stdin)
assert (j["typical_angle_degrees"] is None) == alone, j
for v in j["views"]:
    assert v["late_frames"] is None and v["late_tolerance_frames"] is None, v
    assert (v["angle_degrees"] is None) == (v["shared"] is None) == alone, v
' $name <"$tmp/out" >>"$tmp/bad" 2>&1 || complain "check --json of $name"
done
# Poses in another convention must be named, and the capture that --fix writes
# must have no fault.
expect 0 synth "$tmp/poses" --size 240x136 --cameras 5 --hold-out 0 --frames 1 \
    --depth-every 0 --points 400
python3 - "$tmp/poses/transforms.json" >>"$tmp/bad" 2>&1 <<'PYTHON'
import json, sys

j = json.load(open(sys.argv[1]))
for f in j["frames"]:
    # Write world to camera in OpenCV's axes: R^T and -R^T C with x right, y
    # down, z forward.
    m = f["transform_matrix"]
    axes = [[s * m[i][k] for i in range(3)]
            for k, s in ((0, 1), (1, -1), (2, -1))]
    f["transform_matrix"] = [a + [-sum(a[i] * m[i][3] for i in range(3))]
                             for a in axes] + [[0, 0, 0, 1]]
json.dump(j, open(sys.argv[1], "w"))
PYTHON
expect 0 check "$tmp/poses" --fix "$tmp/poses/fixed.json"
grep -q 'matrices are world to camera, and camera axes are OpenCV' "$tmp/out" ||
    complain "check: no word of wrong poses"
expect 0 check "$tmp/poses/fixed.json"
grep -q '^nothing needs attention' "$tmp/out" ||
    complain "check --fix: $(sed -n '/needs attention/,/^$/p' "$tmp/out")"
expect 0 check "$tmp/poses/fixed.json" --fix "$tmp/poses/again.json"
grep -q 'nothing was found that --fix' "$tmp/err" && [ ! -e "$tmp/poses/again.json" ] ||
    complain "check --fix of what is right"
# A folder may be named in another way, as long as it is the same folder.
# The capture's own points.ply is not replaced.
echo "more" >>"$tmp/poses/points.ply"
cp "$tmp/poses/points.ply" "$tmp/points.ply"
expect 0 check "$tmp/./poses" --fix "$tmp/poses/../poses/points.json"
sed s/points.json.ply/fixed.json.ply/ "$tmp/poses/points.json" |
    cmp -s - "$tmp/poses/fixed.json" &&
    cmp -s "$tmp/points.ply" "$tmp/poses/points.ply" ||
    complain "check --fix beside the capture"
# So must poses whose world is a mirror image, which training refuses.
python3 - "$tmp/poses" >>"$tmp/bad" 2>&1 <<'PYTHON'
import json, sys

j = json.load(open(sys.argv[1] + "/fixed.json"))
for f in j["frames"]:
    f["transform_matrix"][0] = [-x for x in f["transform_matrix"][0]]
json.dump(j, open(sys.argv[1] + "/left.json", "w"))
PYTHON
expect 0 check "$tmp/poses/left.json" --fix "$tmp/poses/right.json"
grep -q 'the world is a mirror image' "$tmp/out" ||
    complain "check: no word of a mirrored world"
expect 0 check "$tmp/poses/right.json"
if grep -q 'do not fit\|mirror' "$tmp/out"; then
    complain "check --fix: $(sed -n '/needs attention/,/^$/p' "$tmp/out")"
fi
told 1 'mirror images (determinant -1)' encode "$tmp/poses/left.json" \
    -o "$tmp/left.saga"
# So must poses of another layout, COLMAP's, that are camera to world.
python3 - "$tmp/poses" "$tmp/inverse" >>"$tmp/bad" 2>&1 <<'PYTHON'
import json, math, os, shutil, sys

j = json.load(open(sys.argv[1] + "/fixed.json"))
os.makedirs(sys.argv[2] + "/sparse/0")
cameras, images, points = (open("%s/sparse/0/%s.txt" % (sys.argv[2], name), "w")
                           for name in ("cameras", "images", "points3D"))
for i, f in enumerate(j["frames"], 1):
    print(i, "PINHOLE", *(f.get(k, j.get(k)) for k in
                          ("w", "h", "fl_x", "fl_y", "cx", "cy")), file=cameras)
    m = f["transform_matrix"]
    r = [[row[0], -row[1], -row[2]] for row in m[:3]]
    # The quaternion (w, x, y, z) has squares as on the diagonal of r, and signs
    # as in its other elements, with w > 0.
    half = lambda a, b, c: math.sqrt(max(0, 1 + a * r[0][0] + b * r[1][1] +
                                         c * r[2][2])) / 2
    q = [half(1, 1, 1)] + [
        math.copysign(half(*s), r[a][b] - r[b][a])
        for s, a, b in (((1, -1, -1), 2, 1), ((-1, 1, -1), 0, 2),
                        ((-1, -1, 1), 1, 0))]
    os.makedirs(sys.argv[2] + "/images", exist_ok=True)
    name = "cam%02d.png" % i
    shutil.copy(os.path.join(sys.argv[1], f["file_path"]),
                "%s/images/%s" % (sys.argv[2], name))
    print(i, *q, *(row[3] for row in m[:3]), i, name, file=images)
    print("60 68 1 120 68 2", file=images)
for i in 1, 2:
    print(i, 0, i, 1, 255, 0, 0, 0.5,
          *("%d %d" % (k, i - 1) for k in range(1, 6)), file=points)
PYTHON
expect 0 check "$tmp/inverse" --fix "$tmp/inverse/cameras.json"
grep -q ': poses are camera to world. --fix' "$tmp/out" ||
    complain "check: no word of COLMAP's inverted poses"
expect 0 check "$tmp/inverse/cameras.json"
grep -q 'nerfstudio, 5 cameras, .* 2 points' "$tmp/out" &&
    ! grep -q 'do not fit' "$tmp/out" ||
    complain "check --fix: $(sed -n '/needs attention/,/^$/p' "$tmp/out")"
# A name that JSON cannot hold is named as such, and leaves no file.
name=$(printf 'cam\37701.png')
mv "$tmp/inverse/images/cam01.png" "$tmp/inverse/images/$name"
LC_ALL=C sed -i "s/cam01.png/$name/" "$tmp/inverse/sparse/0/images.txt"
told 2 'names in UTF-8' check "$tmp/inverse" --fix "$tmp/inverse/other.json"
[ -z "$(find "$tmp/inverse" -name "other*")" ] ||
    complain "check --fix left a file"
# Small errors must be found, too. All cameras shared one lens; each must get a
# lens of its own.
python3 - "$tmp/poses" >>"$tmp/bad" 2>&1 <<'PYTHON'
import json, sys

j = json.load(open(sys.argv[1] + "/fixed.json"))
for i, f in enumerate(j["frames"]):
    f["fl_x"] = f.get("fl_x", j.get("fl_x")) * (1.01, 0.99, 1.005)[i % 3]
    # Turn the camera by 0.3 degrees about its x or y axis.
    for row in f["transform_matrix"][:3]:
        row[2] += (0.005, -0.005)[i // 2 % 2] * row[i % 2]
        row[i % 2] -= (0.005, -0.005)[i // 2 % 2] * row[2]
json.dump(j, open(sys.argv[1] + "/moved.json", "w"))
PYTHON
expect 0 check "$tmp/poses/moved.json" --fix "$tmp/poses/refined.json"
grep -q 'Poses and lenses can be refined' "$tmp/out" ||
    complain "check: no word of poses that can be refined"
expect 0 check "$tmp/poses/refined.json"
grep -q '^nothing needs attention' "$tmp/out" ||
    complain "check --fix: $(sed -n '/needs attention/,/^$/p' "$tmp/out")"
for name in "$tmp/poses/transforms.json" "$tmp/./poses/transforms.json" \
    "$tmp/fixed.json"; do
    told 2 'must lie there under a new name' check "$tmp/poses" --fix "$name"
done
told 2 "$tmp/none" check "$tmp/none"
told 1 'holds no capture of a known format' check "$tmp/dim/images"
says '(docs/from-cameras.md explains how' '`saga help check` lists the layouts'
told 2 "$tmp/none/x.html" check "$tmp/dim" --html "$tmp/none/x.html"
verdict check

# ---- eval
# The pictures the file gives in its rig, as a capture.
take vectors/good/steep.saga
cat >"$tmp/capture.py" <<'PYTHON'
import json, os, subprocess, sys

saga, name, folder, held = sys.argv[1:5]
info = json.loads(subprocess.check_output([saga, "info", name, "--json"]))
frames, test = [], []
for index, c in enumerate(info["rig"]):
    view = "images/cam%02d" % index
    os.makedirs(folder + "/" + view)
    subprocess.check_call(
        [saga, "render", name, "--camera", str(index), "--frames",
         "0:%d" % info["n_frames"], "-o", folder + "/" + view + "/%05d.png"])
    r = c["rotation"]
    pose = [[r[i], -r[3 + i], -r[6 + i], c["centre_metres"][i]]
            for i in range(3)] + [[0, 0, 0, 1]]
    for k in range(info["n_frames"]):
        path = "%s/%05d.png" % (view, k)
        if view.endswith(held):
            test.append(path)
        frames.append({
            "file_path": path, "transform_matrix": pose, "time": k / 30,
            "fl_x": c["focal"][0], "fl_y": c["focal"][1],
            "cx": c["principal"][0], "cy": c["principal"][1],
            "w": c["width"], "h": c["height"]})
train = [f["file_path"] for f in frames if f["file_path"] not in test]
json.dump({"fps": 30, "frames": frames, "train_filenames": train,
           "test_filenames": test},
          open(folder + "/transforms.json", "w"))
PYTHON
cap=$tmp/cap
python3 "$tmp/capture.py" "$saga" "$scene" "$cap" cam02 2>"$tmp/py" ||
    complain "no capture: $(tail -n 1 "$tmp/py")"
expect 0 eval "$scene" "$cap" --json --pictures "$tmp/pictures"
python3 -c 'import json, os, sys
j = json.load(open(sys.argv[1]))
assert [v["held_out"] for v in j["views"]] == [False, False, True]
assert [v["rig_camera"] for v in j["views"]] == [0, 1, 2]
assert (j["n_training"], j["n_held_out"]) == (2, 1)
for v in j["views"] + [j["training"], j["held_out"]]:
    assert v["psnr"] is None or v["psnr"] > 70, v
    assert v["ssim_zero"] > 0.99999 and v["ssim_valid"] > 0.99999, v
    assert v["ms_ssim"] is None
    assert v["changing_psnr"] is None or v["changing_psnr"] > 70, v
    assert 0 < v["changing_share"] < 1, v
    assert 10 < v["median_psnr_of_mean_mse"] <= v["median_psnr"] < 70, v
changing = [v["changing_pixels"] for v in j["views"]]
assert j["training"]["changing_pixels"] == changing[0] + changing[1]
assert j["held_out"]["changing_pixels"] == changing[2]
frames = int(sys.argv[3])
pixels = [frames * v["width"] * v["height"] for v in j["views"]]
assert abs(changing[2] / pixels[2] - j["held_out"]["changing_share"]) < 1e-8
assert "median" in j["protocol"] and "changing" in j["protocol"]
assert sum(j["bytes"].values()) == j["nbytes"] == os.path.getsize(sys.argv[2])
assert j["decode_ms"]["n_views"] == 3 * frames
assert j["decode_ms"]["n_segments"] == 1
# The file has no viewing volume; check_encode.sh has some that do.
assert j["volume"] == {}, j["volume"]
p = j["protocol"]
assert (j["schema"], j["command"], j["program"][:5]) == (1, "eval", "saga ")
assert p["frames"] == p["file_frames"] == [0, frames]
assert [(c["name"], c["held_out"]) for c in p["cameras"]] == [
    ("cam00", False), ("cam01", False), ("cam02", True)], p["cameras"]
assert all(c["resolution"] == [v["width"], v["height"]]
           for c, v in zip(p["cameras"], j["views"])), p["cameras"]' \
    "$tmp/out" "$scene" "$frames" 2>"$tmp/py" ||
    complain "eval of a file's own pictures: $(tail -n 1 "$tmp/py")"
[ "$(ls "$tmp/pictures" | tr '\n' ' ')" = \
    "cam00_$middle.png cam01_$middle.png cam02_$middle.png " ] ||
    complain "pictures: $(ls "$tmp/pictures")"
expect 0 eval "$scene" "$cap" --threads 1 --hold-out cam00
grep -Eq '^cam00 +held out ' "$tmp/out" || complain "--hold-out cam00: not held"
grep -Eq '^mean of 2 +training ' "$tmp/out" || complain "no mean of training"
grep -q '^protocol' "$tmp/out" || complain "no protocol"
awk 'length > 100 { print "eval: " length " columns" }
    NF == 0 { rows = 0 }
    rows && $1 == "file" && $2 != sum { print "bytes: " sum ", not " $2 }
    rows { sum += $(NF - 2) }
    $0 == "bytes" { rows = 1 }
    END { if (!sum) print "no bytes" }' "$tmp/out" >>"$tmp/bad"
# The scores of a part of the film must be those of the same frames in the whole
# film. In a single frame no pixel changes.
expect 0 eval "$scene" "$cap" --json --no-ssim --compare 3:5
cp "$tmp/out" "$tmp/part"
expect 0 eval "$scene" "$cap" --json --no-ssim --compare 3:4
cp "$tmp/out" "$tmp/three"
expect 0 eval "$scene" "$cap" --json --no-ssim --compare 4:5
python3 -c 'import json, sys
part, three, four = [json.load(open(n)) for n in sys.argv[1:]]
assert part["protocol"]["file_frames"] == [3, 5] == part["protocol"]["frames"]
for a, b, c in zip(part["views"], three["views"], four["views"]):
    assert abs(2 * a["mse"] - b["mse"] - c["mse"]) < 1e-8, (a, b, c)
    assert b["changing_psnr"] is None and b["changing_share"] == 0, b
assert part["nbytes"] == three["nbytes"] == four["nbytes"]' \
    "$tmp/part" "$tmp/three" "$tmp/out" 2>"$tmp/py" ||
    complain "eval --compare: $(tail -n 1 "$tmp/py")"
expect 0 eval "$scene" "$cap" --no-ssim --compare "$((frames - 1)):"
grep -q "^  frames    $((frames - 1)) of it alone; the file's" "$tmp/out" ||
    complain "--compare of the last frame: $(grep '  frames ' "$tmp/out")"
told 1 "$((frames + 1))" eval "$scene" "$cap" --compare "3:$((frames + 1))"
# The capture is compared with its own pictures as if they were another codec's.
# There must be no error, and no size of a file.
expect 0 eval "$cap" "$cap" --json --no-ssim
python3 -c 'import json, sys
j = json.load(open(sys.argv[1]))
assert len(j["views"]) == 3 and not {"nbytes", "bytes", "decode_ms"} & set(j)
for v in j["views"]:
    assert v["mse"] == 0 and v["psnr"] is None and v["ssim_zero"] is None, v
' "$tmp/out" 2>"$tmp/py" || complain "eval of pictures: $(tail -n 1 "$tmp/py")"
expect 1 eval "$tmp/syn" "$cap"
says "$tmp/syn: has 3 views of 2 frames, the capture 3 of $frames"
# If frame 0 and the last frame of a camera are exchanged, the scores of this
# camera must fall.
mv "$cap/images/cam01/00000.png" "$tmp/swap.png"
mv "$cap/images/cam01/$last.png" "$cap/images/cam01/00000.png"
mv "$tmp/swap.png" "$cap/images/cam01/$last.png"
expect 0 eval "$scene" "$cap" --json --hold-out ''
python3 -c 'import json, sys
j = json.load(open(sys.argv[1]))
assert j["n_held_out"] == 0 and j["held_out"]["psnr"] is None
v = j["views"]
for key in "psnr_of_mean_mse", "changing_psnr":
    assert v[1][key] < 60 < (v[0][key] or 99), key
' "$tmp/out" 2>"$tmp/py" || complain "swapped frames are not noticed"
expect 1 eval "$scene" "$cap" --frames 0:$((frames - 1))
says "$frames frames, the capture gives $((frames - 1))"
told 1 "$frames frames, the capture gives 2" eval "$scene" "$tmp/syn"
told 2 "$tmp/nowhere" eval "$scene" "$tmp/nowhere"
told 1 'cam09' eval "$scene" "$cap" --hold-out cam09
told 2 '--scale takes 1/N, 1 to 64' eval "$scene" "$cap" --scale 1/0
told 1 'chunk PRIM' eval vectors/bad/crc_segment.saga "$cap"
told 2 "$scene/x" eval "$scene" "$cap" --pictures "$scene/x"
mkdir -m 555 "$tmp/fixed"
# root may write to any folder, so that the check drops these rights.
[ "$(id -u)" = 0 ] && as=(setpriv --bounding-set=-all) || as=()
if ! "${as[@]}" touch "$tmp/fixed/x" 2>/dev/null; then
    "${as[@]}" "$saga" eval "$scene" "$cap" --no-ssim \
        --pictures "$tmp/fixed/x" >"$tmp/out" 2>"$tmp/err"
    [ $? = 2 ] || complain "eval: pictures in a folder that is fixed"
    says "$tmp/fixed/x: cannot be made (Permission denied); give another"
fi
verdict eval

all_passed
