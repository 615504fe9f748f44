#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_devices.sh: guarantees, for `saga devices` and `saga encode --device`,
#   without     a program that was built without Vulkan (SAGA_NO_VULKAN) links,
#               has nothing of it, and says so; it trains on the processor
#   absent      on a machine without a driver, the same in other words
#   list        Mesa's driver for processors (lavapipe) is listed, as text and
#               as JSON
#   choose      --device takes numbers of the list; auto and gpu leave
#               processors out; other words and numbers are refused, with a
#               remedy
#   room        check and encode tell the device's memory that a training takes,
#               and refuse one that the device cannot have
#   move        a training stopped in the rendering stage goes on to the same
#               bytes on its device, and to a film on the processor; and one of
#               the processor goes on on the device
#   valid       what a training makes Vulkan do is correct, and each command
#               waits for what it reads: the layers that validate this are
#               silent, and two trainings give the same bytes
# Without lavapipe or the layers, what needs them is skipped, which is said.
# shellcheck disable=SC2034,SC2154,SC1091
set -u
cd "$(dirname "$0")/../.." || exit
build=${BUILD:-build}
[ ! -d "$build/gcc" ] || build=$build/gcc # of run_tests.sh
saga=${SAGA:-$build/saga}
export OMP_NUM_THREADS=1

checks=devices
. tests/cli/verdict.sh

skip() { # skip NAME WHY
    echo "ok   $checks $1: skipped, $2"
    passed=$((passed + 1))
}

"$saga" synth "$tmp/scene" --size 64x36 --frames 2 --cameras 4 --quiet \
    >"$tmp/log" 2>&1 || complain "synth: $(tail -n 1 "$tmp/log")"
encode=(encode "$tmp/scene" --primitives 100 --preset fast --iterations 20
    --quiet)
# train NAME DEVICE: makes $tmp/NAME.saga.
train() { expect 0 "${encode[@]}" -o "$tmp/$1.saga" --device "$2"; }
# refused TEXT DEVICE: the device is refused with a line that has the text.
refused() {
    expect 2 "${encode[@]}" -o "$tmp/none.saga" --device "$2"
    tail -n 1 "$tmp/err" | grep -qF -e "$1" ||
        complain "--device $2: no '$1' in: $(tail -n 1 "$tmp/err")"
    [ ! -e "$tmp/none.saga" ] || complain "--device $2 leaves a file"
}
run_as=("$saga")
train cpu cpu

# ---- without: the program is linked again, with these objects first
mkdir "$tmp/objects"
for f in trainer/gpu/compute*.c trainer/gpu/volk.c; do
    gcc -std=c11 -Wall -Wextra -Werror -DSAGA_NO_VULKAN -Itrainer/basics \
        -c "$f" -o "$tmp/objects/$(basename "$f" .c).o" 2>>"$bad"
done
link=$("${MAKE:-make}" -n BUILD="$build" CC=gcc \
    -W "$build/obj/trainer/cli/main.o" "$build/saga" |
    sed -n "s|^\(gcc .*\) -o $build/saga\$|\1|p")
# shellcheck disable=SC2086
${link/ / $tmp/objects/*.o } -o "$tmp/saga" 2>>"$bad" ||
    complain "the program without Vulkan cannot be linked"
! strings "$tmp/saga" | grep -q vkCreateDevice || complain "it has Vulkan"
strings "$saga" | grep -q vkCreateDevice || complain "nor has the other"
run_as=("$tmp/saga")
expect 0 devices
grep -q '^no devices: .* built without Vulkan; build it with' "$tmp/out" ||
    complain "devices: $(cat "$tmp/out")"
refused "built without Vulkan; build it with" gpu
refused "built without Vulkan; build it with" 0
train without auto
cmp "$tmp/cpu.saga" "$tmp/without.saga" >>"$bad" 2>&1
verdict without

# ---- absent: both names of the variable that lists drivers
run_as=(env VK_ICD_FILENAMES=/absent VK_DRIVER_FILES=/absent "$saga")
expect 0 devices
grep -q '^no devices: .*; install ' "$tmp/out" ||
    complain "devices: $(cat "$tmp/out")"
expect 0 devices --json
grep -q '"devices": \[\]' "$tmp/out" || complain "--json: $(cat "$tmp/out")"
refused "; install " gpu
train absent auto
cmp "$tmp/cpu.saga" "$tmp/absent.saga" >>"$bad" 2>&1
verdict absent

driver=$(find /usr/share/vulkan/icd.d -name 'lvp_icd*.json' 2>/dev/null |
    head -n 1)
if [ -z "$driver" ]; then
    for name in list choose room move valid; do
        skip $name "mesa-vulkan-drivers is not installed"
    done
    all_passed
    exit
fi

# ---- list
run_as=(env VK_ICD_FILENAMES="$driver" VK_DRIVER_FILES="$driver" "$saga")
expect 0 devices --json
cp "$tmp/out" "$tmp/json"
expect 0 devices
python3 - "$tmp/json" "$tmp/out" 2>>"$bad" <<'PYTHON' || complain "wrong list"
import json, re, sys
(one,) = json.load(open(sys.argv[1]))["devices"]
head, row = open(sys.argv[2]).read().splitlines()
assert one["number"] == 0 and one["lacks"] is None, one
assert one["kind"] == "cpu" and one["memory"] > 1 << 20, one
assert re.fullmatch(r"1\.[1-9]\.\d+", one["vulkan"]), one
assert "llvmpipe" in one["name"] and "Mesa" in one["driver"], one
assert row.split() == ["0", *one["name"].split(), one["kind"],
                       f"{one['memory'] * 1e-9:.1f}", "GB", "yes"], row
PYTHON
verdict list

# ---- choose
train auto auto
cmp "$tmp/cpu.saga" "$tmp/auto.saga" >>"$bad" 2>&1
refused "no usable GPU; see \`saga devices\`, or give --device cpu" gpu
refused "no device 1, only 0 to 0; see \`saga devices\`" 1
expect 2 "${encode[@]}" -o "$tmp/none.saga" --device 0 --ablate slots=256
tail -n 1 "$tmp/err" | grep -qF 'slots=256 is more than the 128 of level 2' ||
    complain "too many slots: $(tail -n 1 "$tmp/err")"
refused "takes auto, cpu, gpu or a number of \`saga devices\`, not '0x'" 0x
train first 0
grep -q 'device 0, llvmpipe' "$tmp/err" || complain "no word of device 0"
verdict choose

# ---- room
grep -qE 'takes 0\.0[0-9] of the device.s [0-9.]+ GB' "$tmp/err" ||
    complain "no word of memory: $(cat "$tmp/err")"
expect 0 check "$tmp/scene" --quiet --device 0 --json
python3 - "$tmp/out" 2>>"$bad" <<'PYTHON' || complain "wrong forecasts"
import json, sys
report = json.load(open(sys.argv[1]))
assert "llvmpipe" in report["device"], report["device"]
most = 1
for f in report["forecast"]:
    assert 0 < most <= f["device_nbytes"] < report["device_memory_nbytes"], f
    assert f["device_lacks"] is None, f
    most = f["device_nbytes"]
PYTHON
expect 0 check "$tmp/scene" --quiet --device 0 --html "$tmp/check.html"
grep -qE '<td>0\.0[0-9] of [0-9.]+ GB of llvmpipe' "$tmp/check.html" ||
    complain "the page has no word of the device's memory"
expect 0 check "$tmp/scene" --quiet --json
grep -q '"device": null' "$tmp/out" || complain "check without --device has one"
expect 2 check "$tmp/scene" --quiet --device 99
tail -n 1 "$tmp/err" | grep -qF 'no device 99, only 0 to 0' ||
    complain "check --device 99: $(tail -n 1 "$tmp/err")"
expect 2 "${encode[@]}" -o "$tmp/none.saga" --device 0 --primitives 4000000 \
    --level 3 --memory 999
tail -n 1 "$tmp/err" |
    grep -qE 'MiB for .* more than a buffer .*; use fewer --primitives' ||
    complain "too many: $(tail -n 1 "$tmp/err")"
[ ! -e "$tmp/none.saga" ] || complain "too many leave a file"
verdict room

# ---- move
longer=(encode "$tmp/scene" --primitives 100 --preset fast --iterations 120
    --quiet)
# stop DEVICE: leaves $tmp/s.saga.ckpt of the rendering stage.
stop() {
    local pid i=0
    rm -f "$tmp"/s.saga*
    $stoppable "${run_as[@]}" "${longer[@]}" -o "$tmp/s.saga" --device "$1" \
        --checkpoint-every 0 >"$tmp/out" 2>"$tmp/err" </dev/null &
    pid=$!
    while ! grep -qs rendering "$tmp/s.saga.ckpt.csv" && [ $i -lt 3000 ]; do
        sleep 0.02
        i=$((i + 1))
    done
    kill -INT "$pid"
    wait "$pid"
    [ $? = 2 ] || complain "stopped on $1: $(tail -n 1 "$tmp/err")"
}
go_on() { expect 0 "${longer[@]}" -o "$tmp/s.saga" --device "$1" --resume; }
set -m # without, a job in the background ignores SIGINT
expect 0 "${longer[@]}" -o "$tmp/whole.saga" --device 0
stop 0
cp "$tmp/s.saga.ckpt" "$tmp/kept"
go_on 0
cmp "$tmp/whole.saga" "$tmp/s.saga" >>"$bad" 2>&1
rm -f "$tmp"/s.saga*
mv "$tmp/kept" "$tmp/s.saga.ckpt"
go_on cpu
stop cpu
go_on 0
set +m
verdict move

# ---- valid: the loader says whether it has found the layer
layer=VK_LAYER_KHRONOS_validation
sync=VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT
run_as=(env VK_INSTANCE_LAYERS=$layer VK_LAYER_ENABLES=$sync
    VK_LOADER_DEBUG=layer "${run_as[@]:1}")
train second 0
if grep -q "Insert instance layer .*$layer" "$tmp/err"; then
    ! grep -hE 'Validation|VUID|SYNC-HAZARD' "$tmp/out" "$tmp/err" |
        grep -v 'LAYER:' >>"$bad"
    cmp "$tmp/first.saga" "$tmp/second.saga" >>"$bad" 2>&1
    verdict valid
else
    skip valid "vulkan-validationlayers is not installed"
fi
all_passed
