#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_tree.sh: guarantees, for every source file of the tree,
#   includes    common includes headers of common only; decoder those of common
#               and decoder; a room (a folder) of the trainer those of common,
#               saga.h and the rooms that the Makefile allows it, and cli also
#               verify.h; reference those of common, decoder and the
#               trainer's basics and code; tools and ports saga.h, and
#               ports/windows dec_output.h. common and decoder use only the
#               freestanding system headers. No #include has a path, except one
#               of a kernel's source in trainer/gpu
#   rooms       a room of the trainer includes headers of rooms below it only,
#               and the table of docs/architecture.md agrees with the Makefile
#   threads     the rooms of training use saga_parallel instead of OpenMP
#               regions, whose threads must all arrive at the end
#   names       file names are unique in the tree
#   licence     one of the first three lines is an SPDX line
#   text        files are ASCII, without tabs (except in a Makefile) and
#               trailing blanks, and end with a newline; lines of C and GLSL
#               have at most 80 columns, except in generated tables (*_tables.h,
#               kernels.c)
#   length      files of common, decoder, trainer, reference, tools and ports
#               have at most 620 lines
# It reads the files that git would add, or the whole folder without git.
set -eu
cd "${1:-$(dirname "$0")/..}"

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

{
    if git rev-parse --is-inside-work-tree >/dev/null 2>&1; then
        git ls-files -co --exclude-standard
    else
        find . -name .git -prune -o -path ./build -prune -o -type f -print |
            sed 's|^\./||'
    fi
} | while read -r f; do [ ! -f "$f" ] || echo "$f"; done | sort >"$tmp/all"
grep -E '\.(c|h|comp|glsl|sh|py|js|css|html)$|\.d\.ts$|(^|/)Makefile$|^\.ci/run$' "$tmp/all" >"$tmp/source"
grep -E '\.[ch]$' "$tmp/source" >"$tmp/c" || :

: >"$tmp/bad"
verdict() { # verdict NAME: the complaints on stdin
    if [ -s "$tmp/bad" ]; then
        sed 's/^/     /' "$tmp/bad"
        echo "FAIL tree $1"
        echo x >"$tmp/failed"
    else
        echo "ok   tree $1"
    fi
    : >"$tmp/bad"
}

# ---- rooms: "ROOM SEEN...", from the ground up
sed -n 's/^SEE_\([a-z/]*\) *:= *\(.*\)$/\1 \2/p' Makefile >"$tmp/rooms"
{
    awk '{ seen[$1] = 1
           for (i = 2; i <= NF; i++)
               if (!($i in seen)) print $1 " sees " $i ", which is above it" }
        ' "$tmp/rooms"
    find trainer -name '*.[ch]' | sed 's|^trainer/||; s|/[^/]*$||' | sort -u |
        while read -r r; do
            grep -q "^$r " "$tmp/rooms" || echo "trainer/$r: no SEE_$r"
        done
    if [ -e docs/architecture.md ]; then
        sed -n 's/^| `trainer\/\([a-z/]*\)` |.*| \([a-z/ ,]*\) |$/\1 \2/p' \
            docs/architecture.md | sed 's/,//g; s/ nothing$/ /' |
            diff "$tmp/rooms" - | sed -n 's/^>/architecture.md:/p
                s/^</Makefile:/p'
    fi
} >"$tmp/bad"
verdict rooms

# ---- includes
awk '
# trainer/ROOM or the top folder.
function folder(f) {
    if (f ~ /^trainer\//) sub(/\/[^\/]*$/, "", f)
    else sub(/\/.*/, "", f)
    return f
}
function name(f) { sub(/.*\//, "", f); return f }
FILENAME ~ /rooms$/ {
    may["trainer/" $1] = " common trainer/" $1 " "
    for (i = 2; i <= NF; i++) may["trainer/" $1] = may["trainer/" $1] \
        "trainer/" $i " "
    next
}
{ at[name($0)] = folder($0); files[++n] = $0 }
END {
    split("stddef stdint stdbool limits stdalign stdarg stdnoreturn iso646", s,
          " ")
    for (i in s) free[s[i] ".h"] = 1
    may["common"] = " common "
    may["decoder"] = " common decoder "
    may["reference"] = " common decoder reference trainer/basics " \
        "trainer/code "
    may["tools"] = " tools "
    may["ports"] = " ports "
    for (i = 1; i <= n; i++) {
        f = files[i]; d = folder(f)
        if (!(d in may)) continue
        line = 0
        while ((getline text < f) > 0) {
            line++
            if (text !~ /^[ \t]*#[ \t]*include/) continue
            where = f ":" line ": "
            if (match(text, /<[^>]*>/)) {
                h = substr(text, RSTART + 1, RLENGTH - 2)
                if ((d == "common" || d == "decoder") && !(h in free) &&
                    f !~ /^decoder\/arch\//)
                    print where "<" h "> is not freestanding"
            } else if (match(text, /"[^"]*"/)) {
                h = substr(text, RSTART + 1, RLENGTH - 2)
                if (d == "trainer/gpu" && h ~ /^kernels\/[a-z]*[.]glsl$/)
                    continue
                else if (h ~ /\//)
                    print where "path in \"" h "\""
                else if (h == "saga.h" && d != "common")
                    continue
                else if (h == "verify.h" && d == "trainer/cli")
                    continue
                else if (h == "dec_output.h" && f ~ /^ports\/windows\//)
                    continue
                else if (!(h in at))
                    print where "\"" h "\" is nowhere in the tree"
                else if (index(may[d], " " at[h] " ") == 0)
                    print where d " must not see " at[h] "/" h
            } else
                print where "include by macro"
        }
        close(f)
    }
}' "$tmp/rooms" "$tmp/c" >"$tmp/bad"
verdict includes

# ---- threads
grep -E '^trainer/(nn|splat|rig|scene|entropy|warm|train)/' "$tmp/c" |
    xargs grep -nE '#[ ]*pragma +omp' >"$tmp/bad" || :
verdict threads

# ---- names
sed 's|.*/||' "$tmp/source" | sort | uniq -d | while read -r n; do
    grep -E "(^|/)$n\$" "$tmp/source" | tr '\n' ' '
    echo
done >"$tmp/bad"
verdict names

# ---- licence
tr '\n' '\0' <"$tmp/source" | xargs -0 awk '
    FNR == 1 { files[++n] = FILENAME }
    FNR <= 3 && /SPDX-License-Identifier: MIT/ { has[FILENAME] = 1 }
    END { for (i = 1; i <= n; i++) if (!(files[i] in has))
              print files[i] ": no SPDX-License-Identifier: MIT" }' \
    >"$tmp/bad"
verdict licence

# ---- text: a last line without a newline is one that awk counts and wc does not
tr '\n' '\0' <"$tmp/source" | xargs -0 wc -l >"$tmp/lines"
tr '\n' '\0' <"$tmp/source" | LC_ALL=C xargs -0 awk -v lines="$tmp/lines" '
    FNR == 1 { limit = FILENAME ~ /\.([ch]|comp|glsl)$/ && FILENAME !~ /_tables\.h$|\/kernels\.c$/ }
    { n[FILENAME] = FNR }
    function complain(what) { print FILENAME ":" FNR ": " what }
    /\t/ && FILENAME !~ /Makefile$/ { complain("tab") }
    /[ \t]$/ { complain("trailing blank") }
    /[^ -~\t]/ { complain("not ASCII") }
    limit && length > 80 { complain(length " columns") }
    END { while ((getline text < lines) > 0) {
              split(text, f, " ")
              if (f[2] in n && n[f[2]] != f[1])
                  print f[2] ": no newline at the end" } }' >"$tmp/bad"
verdict text

# ---- length
awk '$2 ~ /^(common|decoder|trainer|reference|tools|ports)\// && $1 > 620 {
         print $2 ": " $1 " lines" }' "$tmp/lines" >"$tmp/bad"
verdict length

[ ! -e "$tmp/failed" ]
