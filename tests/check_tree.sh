#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_tree.sh: guarantees, for every source file of the tree,
#   includes    common sees common; decoder sees common and decoder; trainer
#               sees common, trainer and saga.h; tools see saga.h; common and
#               decoder use no system header but the freestanding ones; no
#               path in an #include
#   names       file names are unique in the tree
#   licence     an SPDX line among the first three
#   text        no tab (but in a Makefile), no trailing blank, a newline at
#               the end, ASCII; C lines of at most 80 columns, except in
#               generated tables (*_tables.h)
# It reads what git would add, or the whole folder where there is no git.
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
grep -E '\.(c|h|sh|py)$|(^|/)Makefile$|^\.ci/run$' "$tmp/all" >"$tmp/source"
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

# ---- includes
awk '
function folder(f) { sub(/\/.*/, "", f); return f }
function name(f) { sub(/.*\//, "", f); return f }
NR == FNR { at[name($0)] = folder($0); next }
{ files[++n] = $0 }
END {
    split("stddef stdint stdbool limits stdalign stdarg stdnoreturn iso646", s,
          " ")
    for (i in s) free[s[i] ".h"] = 1
    may["common"] = " common "
    may["decoder"] = " common decoder "
    may["trainer"] = " common trainer "
    may["tools"] = " "
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
                if (h ~ /\//)
                    print where "path in \"" h "\""
                else if (h == "saga.h" && d != "common")
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
}' "$tmp/c" "$tmp/c" >"$tmp/bad"
verdict includes

# ---- names
sed 's|.*/||' "$tmp/source" | sort | uniq -d | while read -r n; do
    grep -E "(^|/)$n\$" "$tmp/source" | tr '\n' ' '
    echo
done >"$tmp/bad"
verdict names

# ---- licence
while read -r f; do
    head -n 3 "$f" | grep -q 'SPDX-License-Identifier: MIT' ||
        echo "$f: no SPDX-License-Identifier: MIT"
done <"$tmp/source" >"$tmp/bad"
verdict licence

# ---- text
tab=$(printf '\t')
while read -r f; do
    case $f in
    *Makefile) ;;
    *) grep -n "$tab" "$f" | sed "s|^\([0-9]*\):.*|$f:\1: tab|" ;;
    esac
    grep -n '[[:blank:]]$' "$f" |
        sed "s|^\([0-9]*\):.*|$f:\1: trailing blank|"
    LC_ALL=C grep -n '[^ -~'"$tab"']' "$f" |
        sed "s|^\([0-9]*\):.*|$f:\1: not ASCII|"
    [ ! -s "$f" ] || [ -z "$(tail -c 1 "$f")" ] ||
        echo "$f: no newline at the end"
    case $f in
    *_tables.h) ;;
    *.c | *.h)
        awk -v f="$f" \
            'length > 80 { print f ":" FNR ": " length " columns" }' "$f"
        ;;
    esac
done <"$tmp/source" >"$tmp/bad"
verdict text

[ ! -e "$tmp/failed" ]
