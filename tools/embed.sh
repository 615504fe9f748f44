#!/bin/sh
# SPDX-License-Identifier: MIT
#
# embed.sh TABLE FILE...: prints a C source with the bytes of the files, as the
# table saga_TABLE_files of trainer/cli/view_files.h.
set -eu
table=$1
shift

echo '/* Made by tools/embed.sh. */'
echo '#include "view_files.h"'
n=0
for f in "$@"; do
    echo "static const uint8_t bytes_$n[] = {"
    od -An -v -tu1 "$f" | sed 's/  */,/g; s/^,//; s/$/,/'
    echo '};'
    n=$((n + 1))
done
echo "const saga_view_file saga_${table}_files[] = {"
n=0
for f in "$@"; do
    echo "{ \"$(basename "$f")\", bytes_$n, sizeof bytes_$n },"
    n=$((n + 1))
done
echo '};'
echo "const int saga_n_${table}_files = $n;"
