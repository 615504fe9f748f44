#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_kernels.sh: guarantees that trainer/gpu/kernels.c is what `make kernels`
# makes of trainer/gpu/kernels. Versions of the compilers differ in their words,
# so with others than those in its head, or without any, only the checksum of
# the sources is compared, and a line says so.
set -eu
cd "$(dirname "$0")/.."

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

fail() {
    echo "FAIL kernels: $1; \`make kernels\` writes it again"
    exit 1
}
made=trainer/gpu/kernels.c
tools/kernels.sh head >"$tmp/head"
grep -qxF "$(sed -n '/Sources/p' "$tmp/head")" "$made" ||
    fail "the sources of $made have changed"
if ! grep -qxF "$(sed -n '/Compilers/p' "$tmp/head")" "$made"; then
    echo "ok   kernels: skipped but for the sources:" \
        "$(sed -n 's/.*Compilers: //p' "$tmp/head") rather than" \
        "$(sed -n 's/.*Compilers: //p' "$made")"
    exit 0
fi
tools/kernels.sh >"$tmp/kernels.c"
cmp "$tmp/kernels.c" "$made" || fail "$made is not what the compilers make"
echo "ok   kernels: $(grep -c '^static' "$made") in SPIR-V"
