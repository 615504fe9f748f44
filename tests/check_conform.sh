#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_conform.sh: guarantees that the package for implementers is complete,
# that its conform.py passes a correct decoder, and that it names each wrong
# answer of another one.
set -u
cd "$(dirname "$0")/.."
checks=conform
# shellcheck source=tests/cli/verdict.sh
. tests/cli/verdict.sh

decoder=$PWD/${SAGA_CHECK_VECTORS:-build/check_vectors}
[ -x "$decoder" ] || complain "no $decoder: make build/check_vectors"
make -s conformance BUILD="$tmp" || complain "make conformance fails"
tar xzf "$tmp"/dist/saga-conformance-*.tar.gz -C "$tmp" || complain "tar fails"
cd "$tmp"/saga-conformance-* || complain "no folder in the package"
for file in LICENSE docs/bitstream.md docs/arithmetic.md docs/bitstream.ksy \
    docs/decoder-in-a-day.md docs/levels.md vectors/README.md; do
    [ -s $file ] || complain "$file is missing"
done
verdict files

# conform EXPECTED_STATUS EXPECTED_LAST_LINE ARGUMENT...: runs conform.py and
# compares status and last line.
conform() {
    local status=$1 last=$2
    shift 2
    vectors/conform.py "$@" >"$tmp/out" 2>"$tmp/err"
    local got=$?
    [ $got = "$status" ] || complain "$*: exit status $got, not $status"
    [ "$(tail -n 1 "$tmp/out")" = "$last" ] ||
        complain "$*: $(tail -n 1 "$tmp/out"), not $last"
}

# of NAME: prints the number of lines of a list that are not comments.
of() { grep -vc -e '^#' -e '^$' "vectors/$1"; }
n=$(($(of MANIFEST) + $(of REFUSALS)))
conform 0 "$n passed, 0 failed" "$decoder" --answer
conform 0 "$((n + $(of PICTURES))) passed, 0 failed" \
    --pictures "$decoder" --answer
verdict right

# This decoder gives a wrong digit of a frame, a missing column and a wrong
# status.
cat >wrong <<EOF
#!/bin/sh
"$decoder" --answer | sed -e '1s/.\$/x/' -e '2s/[^ ]*\$/-/' -e '\$s/.*/7/'
EOF
chmod +x wrong
conform 1 "$((n - 3)) passed, 3 failed" ./wrong
grep -q 'FAIL good/[^ ]* segment 0, t 0, camera 0: FRAME is .*x, not' \
    "$tmp/out" || complain "the wrong frame is not named: $(cat "$tmp/out")"
grep -q ': no FRAME$' "$tmp/out" || complain "the missing column is not named"
grep -q ': 7, not -\?[0-9]*$' "$tmp/out" || complain "the status is not named"
conform 1 "0 passed, $n failed" true
verdict wrong

# For a decoder of level 0, good files of higher levels must be refused.
above=$(awk '!/^#/ && NF == 11 { print $1 }' vectors/MANIFEST |
    while read -r file; do
        [ "$(od -An -tu1 -j12 -N1 "vectors/$file")" -gt 0 ] && echo "$file"
    done | wc -l)
vectors/conform.py --level 0 "$decoder" --answer >"$tmp/out" 2>&1
[ "$above" -gt 0 ] && [ "$(grep -c 'FAIL good.*, not -13$' "$tmp/out")" = \
    "$(grep -c '^FAIL' "$tmp/out")" ] || complain "level 0: $(tail -1 "$tmp/out")"
grep -q " passed, $above failed" "$tmp/out" ||
    complain "level 0: $(tail -n 1 "$tmp/out"), not $above failed"
verdict level

conform 2 "" ; conform 2 "" /no/such/decoder
verdict usage
all_passed
