#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_docs.sh [FOLDER]: guarantees, for every .md of the tree,
#   width      lines have at most 80 columns, except in tables, code and
#              pictures
#   links      links, paths and each NAME.md in the text lead to files of the
#              tree, relative to the page's folder, to docs/ or to the root;
#              suffixes may be left out, and * matches any text
#   diary      README, docs/, docs/design and docs/results describe the present
#              and mention no sessions and no commits
#   decisions  a paragraph of docs/design has at most 10 lines
#   dates      every page of docs/lab has a date
#   lists      docs/lab/README.md and docs/design/README.md name every page of
#              their folders
#   examples   the commits that docs/adding.md names are in the history, with
#              that subject, if the history is complete
#   metrics    docs/metrics.md has a row for each metric of saga eval
#   findings   docs/troubleshooting.md has a row for each finding of saga check,
#              and none besides
#   remedies   its last table has the first word of each remedy of saga check
#              and saga encode, and none besides (remedies.py)
#   reference  docs/api.md is what tools/api_page.py makes of the sources
set -eu
cd "${1:-$(dirname "$0")/..}"

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

{
    git ls-files -co --exclude-standard '*.md' 2>/dev/null ||
        find . -name build -prune -o -name '*.md' -print | sed 's|^\./||'
} | while read -r f; do [ ! -f "$f" ] || echo "$f"; done | sort >"$tmp/md"

verdict() { # verdict NAME: the complaints in $tmp/bad
    if [ -s "$tmp/bad" ]; then
        sed 's/^/     /' "$tmp/bad"
        echo "FAIL docs $1"
        echo x >"$tmp/failed"
    else
        echo "ok   docs $1"
    fi
}

# ---- width
while read -r f; do
    awk -v f="$f" '
        /^```/ { code = !code }
        length > 80 && !code && !/^(\||    |!\[)/ {
            print f ":" FNR ": " length " columns" }' "$f"
done <"$tmp/md" >"$tmp/bad"
verdict width

# ---- links: all that looks like a path
python3 - "$tmp/md" >"$tmp/bad" <<'PYTHON'
import glob, os, re, sys

top = "|".join(sorted(n for n in os.listdir(".") if os.path.isdir(n) and
                      n[0] != "." and n != "build"))
link = re.compile(r"\]\(([^)]*)\)")
# Links, which may be split over lines, URLs and paths of builds.
gone = re.compile(r"\[[^]]*\]\([^)]*\)|^[^][\n]*\]\([^)]*\)|https?://[^ )\n]*"
                  r"|build/[^ `\n]*", re.M)
path = re.compile(r"(?<![A-Za-z0-9_/.*-])((?:\.\./)*(?:(?:%s)/"
                  r"[A-Za-z0-9_./*-]*|[A-Za-z_-]+\.md))" % top)


def exists(at):
    return glob.glob(at) or glob.glob(at + ".*")


for name in open(sys.argv[1], encoding="utf-8").read().split():
    with open(name, encoding="utf-8") as f:
        text = f.read()
    found = {re.sub(r"#.*", "", x) for x in link.findall(text)
             if not re.match(r"https?:|#", x)}
    found |= {re.sub(r"[.-]$", "", x) for x in path.findall(gone.sub("", text))}
    for to in sorted(found - {""}):
        if not any(map(exists, (os.path.join(os.path.dirname(name), to),
                                "docs/" + to, to))):
            print("%s: there is no %s" % (name, to))
PYTHON
verdict links

# ---- diary
grep -nE '^(README|docs/[^/]*|docs/(design|results)/[^/]*)\.md$' "$tmp/md" |
    cut -d: -f2 | xargs grep -niE \
    '(this|last|previous|next) session|session before|as of today|commit [0-9a-f]{7}|`[0-9]*[a-f][0-9a-f]{6,39}`' \
    >"$tmp/bad" || :
verdict diary

# ---- decisions
for f in docs/design/*.md; do
    awk -v f="$f" 'BEGIN { RS = "" }
        !/^\|/ && gsub(/\n/, " ") > 9 {
            print f ": " substr($0, 1, 60) }' "$f"
done >"$tmp/bad"
verdict decisions

# ---- dates
grep -LE '20[0-9]{2}-[0-9]{2}-[0-9]{2}' docs/lab/[a-z]*.md >"$tmp/bad" || :
verdict dates

# ---- lists
for folder in docs/lab docs/design; do
    for f in "$folder"/[a-z]*.md; do
        grep -q "(${f#"$folder"/})" "$folder/README.md" ||
            echo "$f: not in $folder/README.md"
    done
done >"$tmp/bad"
verdict lists

# ---- examples: "| recipe | HASH | SUBJECT |"
grep -E '^\|[^|]*\| [0-9a-f]{7} \|' docs/adding.md >"$tmp/examples"
if [ "$(git rev-parse --is-shallow-repository 2>/dev/null)" = false ]; then
    sed -E 's/^\|[^|]*\| ([0-9a-f]+) \| (.*) \|$/\1 \2/' "$tmp/examples" |
        while read -r hash subject; do
            [ "$(git log -1 --format=%s "$hash" -- 2>/dev/null)" = "$subject" ] ||
                echo "docs/adding.md: no commit $hash, $subject"
        done
fi >"$tmp/bad"
[ -s "$tmp/examples" ] || echo "docs/adding.md: no examples" >>"$tmp/bad"
verdict examples

# ---- metrics: rows as the page has them, of the table in score.c
tr '\n' ' ' <trainer/measure/score.c |
    grep -oE '\.key = "[a-z_]*", +\.label = "[^"]*"' |
    sed -E 's/.*"([a-z_]*)", +\.label = "([^"]*)"/| \2 | `\1` |/' >"$tmp/rows"
while read -r row; do
    grep -qF "$row" docs/metrics.md || echo "docs/metrics.md: no row $row"
done <"$tmp/rows" >"$tmp/bad"
[ -s "$tmp/rows" ] || echo "trainer/measure/score.c: no metrics" >>"$tmp/bad"
verdict metrics

# ---- findings: a note up to its first : or ; or . with ... for its values
python3 - >"$tmp/bad" <<'PYTHON'
import re

text = r'((?:"(?:[^"\\\\]|\\\\.)*"\s*)+)'
found = []


def words(literals):
    note = "".join(re.findall(r'"((?:[^"\\]|\\.)*)"', literals))
    note = re.sub(r"%[-+.0-9]*[a-z]", "\0", note.replace("%%", "%"))
    return re.split("[:;.]", note)[0].rstrip().replace("\0", "...")


for name in ("judge", "pictures"):
    with open("trainer/capture/survey/survey_%s.c" % name) as f:
        source = f.read()
    kinds = dict(re.findall(r"saga_note_kind (\w+) = \{\s*" + text, source))
    notes = re.findall(r"saga_note\([^\"]*?,\s*" + text, source)
    notes += re.findall(r'\? ("The [^"]*")', source)
    for kind, item in re.findall(r"saga_note_each\([^\"]*?&(\w+),\s*" + text,
                                 source):
        notes.append(kinds[kind] if words(kinds[kind]) else item)
    found += [words(n) for n in notes]
with open("docs/troubleshooting.md") as f:
    page = f.read().partition("| finding |")[2].partition("## ")[0]
rows = re.findall(r"^\| ([^|]*) \|", page, re.M)
# One note begins with a choice of words, which the third pattern finds.
for finding in sorted((set(found) - {"..."}) ^ set(rows)):
    print("docs/troubleshooting.md: " + finding + ": " + (
        "no row" if finding in found else "no finding of saga check"))
PYTHON
verdict findings

# ---- remedies
python3 tests/remedies.py >"$tmp/bad" 2>&1 || :
verdict remedies

# ---- reference
if python3 tools/api_page.py "$tmp/api.md" 2>"$tmp/bad"; then
    diff docs/api.md "$tmp/api.md" | head >"$tmp/bad" || :
    [ ! -s "$tmp/bad" ] || echo "run tools/api_page.py" >>"$tmp/bad"
fi
verdict reference

[ ! -e "$tmp/failed" ]
