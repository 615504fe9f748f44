#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_cli.sh: guarantees, for the program `saga` (build/saga, or SAGA=...),
#   help        every command explains itself; --version; no command is a
#               mistake
#   usage       wrong command lines end with status 2, nothing on stdout and
#               one line on stderr that names what is wrong
#   good        `saga info` takes every good vector, in text and JSON, which
#               parses and says what `saga-dec --info` says; the bytes of the
#               parts add up to the file
#   bad         every bad vector whose header or chunks are damaged ends with
#               status 1 and one line that names the file; nothing crashes
set -u
cd "$(dirname "$0")/.." || exit

build=${BUILD:-build}
saga=${SAGA:-$build/saga}
saga_dec=${SAGA_DEC:-$build/saga-dec}
if [ ! -x "$saga" ] || [ ! -x "$saga_dec" ]; then
    "${MAKE:-make}" -s BUILD="$build" "$saga" "$saga_dec" || :
fi
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

passed=0
failed=0
verdict() { # verdict NAME: complaints in $tmp/bad
    if [ -s "$tmp/bad" ]; then
        sed 's/^/     /' "$tmp/bad"
        echo "FAIL cli $1"
        failed=$((failed + 1))
    else
        echo "ok   cli $1"
        passed=$((passed + 1))
    fi
    : >"$tmp/bad"
}
: >"$tmp/bad"
complain() { echo "$*" >>"$tmp/bad"; }

# expect STATUS ARGUMENTS...: runs saga; output in $tmp/out, messages in err.
expect() {
    local want=$1 rc
    shift
    "$saga" "$@" >"$tmp/out" 2>"$tmp/err" </dev/null
    rc=$?
    [ "$rc" = "$want" ] ||
        complain "saga $*: status $rc, not $want: $(head -n 1 "$tmp/err")"
}

# says TEXT: the messages are one line that has it; stdout is empty.
says() {
    [ "$(wc -l <"$tmp/err")" = 1 ] ||
        complain "not one line of message: $(cat "$tmp/err")"
    grep -qF -e "$1" "$tmp/err" || complain "no '$1' in: $(cat "$tmp/err")"
    [ ! -s "$tmp/out" ] || complain "output beside: $(cat "$tmp/err")"
}

# ---- help
expect 0 --help
for c in $(sed -n 's/^  \([a-z][a-z]*\)  *[A-Z].*/\1/p' "$tmp/out"); do
    expect 0 help "$c"
    grep -q "^usage: saga $c " "$tmp/out" || complain "help $c: no usage"
    cp "$tmp/out" "$tmp/help"
    expect 0 "$c" --help
    cmp -s "$tmp/out" "$tmp/help" || complain "$c --help is not help $c"
    awk -v c="$c" 'length > 79 { print "help " c ": " length " columns" }' \
        "$tmp/out" >>"$tmp/bad"
done
grep -q . "$tmp/help" || complain "--help lists no command"
expect 0 --version
grep -Eq '^saga [0-9.]+, files of version [0-9]+$' "$tmp/out" ||
    complain "--version says $(cat "$tmp/out")"
verdict help

# ---- usage
good=vectors/good/segments.saga
expect 2
says 'saga --help'
expect 2 inf "$good"
says "did you mean 'info'"
expect 2 zzz
says "unknown command 'zzz'"
expect 2 help zzz
says "unknown command 'zzz'"
expect 2 info
says 'an argument is missing'
expect 2 info "$good" "$good"
says 'more arguments'
expect 2 info "$good" --jsn
says "did you mean '--json'"
expect 2 info "$good" --json=1
says '--json takes no value'
expect 2 info "$tmp/none.saga"
says "$tmp/none.saga: cannot be opened"
expect 2 info "$tmp"
says "$tmp: cannot be read"
expect 2 info -- --json
says -- '--json: cannot be opened'
if [ -e /dev/full ]; then
    "$saga" info "$good" >/dev/full 2>"$tmp/err"
    [ $? = 2 ] || complain "a full disk is not status 2"
    grep -q 'standard output' "$tmp/err" || complain "a full disk: no message"
fi
verdict usage

# ---- good
cat >"$tmp/agree.py" <<'PYTHON'
import json, sys

j = json.load(open(sys.argv[1]))
said = open(sys.argv[2]).read()
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
        print("saga-dec --info does not say:", what.strip())
s = j["segments"]
for what, a, b in [
    ("bytes", sum(j["bytes"].values()), j["nbytes"]),
    ("segments", len(s), j["n_segments"]),
    ("frames", sum(x["n_frames"] for x in s), j["n_frames"]),
    ("chunks", j["crc"]["chunks_checked"], 2 + 4 * len(s)),
    ("other bytes", j["bytes"]["other"], 0),
    ("most primitives", max(x["n_primitives"] for x in s)
     <= d["max_primitives"], True),
    ("sound", j["crc"]["sound"], True),
]:
    if a != b:
        print(what, a, "!=", b)
PYTHON
n=0
for f in vectors/good/*.saga; do
    n=$((n + 1))
    expect 0 info "$f"
    grep -q 'chunks are right' "$tmp/out" || complain "$f: no word of CRCs"
    [ ! -s "$tmp/err" ] || complain "$f: $(cat "$tmp/err")"
    expect 0 info "$f" --json
    python3 -m json.tool "$tmp/out" >/dev/null 2>&1 ||
        complain "$f: not JSON"
    "$saga_dec" "$f" --info >"$tmp/dec" 2>&1
    python3 "$tmp/agree.py" "$tmp/out" "$tmp/dec" 2>&1 | tail -n 5 |
        sed "s|^|$f: |" >>"$tmp/bad"
done
[ "$n" -ge 5 ] || complain "only $n good vectors"
verdict "good: $n files"

# ---- bad
n=0
for f in vectors/bad/*.saga; do
    n=$((n + 1))
    "$saga" info "$f" >"$tmp/out" 2>"$tmp/err"
    rc=$?
    case $(basename "$f") in
    crc_* | cut_* | magic* | version* | empty*) refused=1 ;;
    *)
        refused=0
        "$saga_dec" "$f" --info >/dev/null 2>&1 || refused=1
        ;;
    esac
    # A stream can be wrong inside sound chunks: only decoding finds that.
    [ "$rc" = "$refused" ] || { [ "$rc" = 1 ] && [ "$refused" = 0 ]; } ||
        complain "$f: status $rc"
    [ "$rc" = 0 ] || grep -qF -e "saga: $f: " "$tmp/err" ||
        complain "$f: the message does not name it: $(cat "$tmp/err")"
    [ "$rc" = 0 ] || [ "$(wc -l <"$tmp/err")" = 1 ] ||
        complain "$f: not one line of message"
done
[ "$n" -ge 20 ] || complain "only $n bad vectors"
# What is no .saga file at all.
expect 1 info tests/check_cli.sh
says 'not a .saga file'
# One byte changed at the end of a segment: told which, the others shown.
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
verdict "bad: $n files"

echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
