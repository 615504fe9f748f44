#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_format.sh [--fix]: guarantees that all C is as clang-format writes it by
# .clang-format, or (--fix) makes it so. Files that are tables of numbers stay
# as they are. Versions of clang-format differ, so another than 14, which is
# Debian 12's, checks nothing and says so.
set -eu
cd "$(dirname "$0")/.."

version=$(clang-format --version 2>/dev/null |
    sed -n 's/.*version \([0-9]*\).*/\1/p')
if [ "$version" != 14 ]; then
    echo "ok   format: skipped, clang-format is ${version:-absent} rather than 14"
    exit 0
fi
files=$(git ls-files '*.c' '*.h' 2>/dev/null ||
    find . -name build -prune -o -name '*.[ch]' -print | sed 's,^\./,,')
files=$(echo "$files" | grep -vE \
    '_tables\.h$|^trainer/gpu/kernels\.c$|^decoder/(alpha|sqrt_up)\.c$|^common/crc32c\.c$')
case ${1:-} in
--fix) echo "$files" | xargs -P 2 -n 40 clang-format -i ;;
*)
    if ! bad=$(echo "$files" | xargs -P 2 -n 40 clang-format --dry-run \
        -Werror 2>&1); then
        echo "$bad" | grep -m 5 error || echo "$bad" | head -n 5
        echo "FAIL format: \`make format\` mends it"
        exit 1
    fi
    echo "ok   format: $(echo "$files" | wc -l) files"
    ;;
esac
