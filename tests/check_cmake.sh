#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_cmake.sh: guarantees that CMakeLists.txt builds and installs the decoder
# library, and that a project which finds it draws the pixels of saga-dec. It is
# skipped without cmake.
set -u
cd "$(dirname "$0")/.." || exit
checks=cmake
# shellcheck source=tests/cli/verdict.sh
. tests/cli/verdict.sh

if ! command -v cmake >/dev/null; then
    echo "ok   cmake skipped: cmake is not installed"
    exit 0
fi
saga_dec=${SAGA_DEC:-${BUILD:-build}/saga-dec}
quietly() {
    "$@" >"$tmp/log" 2>&1 </dev/null || complain "$*: $(tail -n 3 "$tmp/log")"
}

mkdir "$tmp/user"
release=$(sed -n 's/^#define SAGA_RELEASE "\(.*\)"/\1/p' decoder/saga.h)
quietly cmake -S . -B "$tmp/build" -DCMAKE_C_FLAGS=-Werror
quietly cmake --build "$tmp/build" -j 2
quietly cmake --install "$tmp/build" --prefix "$tmp/there"
cp tools/*.[ch] "$tmp/user"
cat >"$tmp/user/CMakeLists.txt" <<CMAKE
cmake_minimum_required(VERSION 3.16)
project(user LANGUAGES C)
find_package(saga $release EXACT REQUIRED)
add_executable(user saga_dec.c dec_options.c dec_output.c)
target_compile_definitions(user PRIVATE SAGA_LEVEL=2 _XOPEN_SOURCE=700)
target_link_libraries(user saga::saga)
CMAKE
quietly cmake -S "$tmp/user" -B "$tmp/user/build" \
    -DCMAKE_PREFIX_PATH="$tmp/there"
quietly cmake --build "$tmp/user/build"
draw() {
    "$1" docs/demo.saga --camera rig:0 --time 0 --crc
}
draw "$saga_dec" >"$tmp/want"
draw "$tmp/user/build/user" >"$tmp/got" 2>&1
[ -s "$tmp/want" ] && cmp -s "$tmp/want" "$tmp/got" ||
    complain "other pixels than saga-dec: $(tail -n 1 "$tmp/got")"
verdict found
all_passed
