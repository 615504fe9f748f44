#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_circles.sh [BUILD]: guarantees that the object files of common/,
# decoder/, reference/ and trainer/ have no circular dependencies by their
# symbols. `make circles` builds the objects first.
set -eu
cd "$(dirname "$0")/.."
obj=${1:-${BUILD:-build}}/obj

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

find common decoder reference trainer -name '*.c' | sort |
    sed "s|\(.*\)\.c\$|$obj/\1.o|" >"$tmp/objects"

# "USER DEFINER SYMBOL" for each symbol that a file has of another one.
tr '\n' '\0' <"$tmp/objects" | xargs -0 nm -A -g >"$tmp/symbols"
awk -v skip="$(printf %s "$obj" | wc -c)" '
    { file = substr($1, skip + 2); sub(/\.o:.*/, "", file) }
    $(NF - 1) ~ /^[A-TV-Z]$/ { at[$NF] = file }
    $(NF - 1) == "U" { user[++n] = file; wants[n] = $NF }
    END { for (i = 1; i <= n; i++)
              if (wants[i] in at && at[wants[i]] != user[i])
                  print user[i], at[wants[i]], wants[i] }' \
    "$tmp/symbols" >"$tmp/arrows"

# tsort names the files of a circle in its message, one on each line.
cut -d' ' -f1,2 "$tmp/arrows" | tsort 2>"$tmp/loops" >"$tmp/order" || :
if [ -s "$tmp/loops" ] || [ ! -s "$tmp/order" ]; then
    sed -n 's/^tsort: \([a-z]*\/\)/\1/p' "$tmp/loops" | sort -u >"$tmp/bad"
    awk 'FILENAME ~ /bad$/ { bad[$1] = 1; next }
        $1 in bad && $2 in bad { print "     " $1 " needs " $2 " for " $3 }' \
        "$tmp/bad" "$tmp/arrows"
    echo "FAIL circles of files"
    exit 1
fi
echo "ok   circles: none among $(wc -l <"$tmp/objects") object files"
