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

# of NAME: prints the number of lines of the lists of a name that are not
# comments.
of() {
    cat vectors/"$1" vectors/v1*/"$1" 2>/dev/null | grep -vc -e '^#' -e '^$'
}
n=$(($(of MANIFEST) + $(of BOXES) + $(of VALUES) + $(of REFUSALS)))
cat >right <<EOF
#!/bin/sh
"$decoder" --answer | tee answers
EOF
# This decoder gives a wrong digit of a frame, a missing column and a wrong
# status. It only repeats answers, since the questions are the same.
cat >wrong <<EOF
#!/bin/sh
sed -e '1s/.\$/x/' -e '2s/[^ ]*\$/-/' -e '\$s/.*/7/' answers
EOF
chmod +x right wrong
all=$((n + $(of PICTURES)))
conform 0 "$all passed, 0 failed" --pictures ./right
verdict right

conform 1 "$((all - 3)) passed, 3 failed" --pictures ./wrong
grep -q 'FAIL good/[^ ]* segment 0, t 0, camera 0: FRAME is .*x, not' \
    "$tmp/out" || complain "the wrong frame is not named: $(cat "$tmp/out")"
grep -q ': no FRAME$' "$tmp/out" || complain "the missing column is not named"
grep -q ': 7, not -\?[0-9]*$' "$tmp/out" || complain "the status is not named"
verdict wrong

# A decoder of level 0 refuses the files of higher levels, damaged ones too,
# unless an earlier check does. One that answers nothing is found out.
vectors/conform.py --level 0 "$decoder" --answer 0 >"$tmp/out" 2>&1
grep -q '^[0-9]* passed, 0 failed$' "$tmp/out" ||
    complain "level 0: $(cat "$tmp/out")"
vectors/conform.py --level 0 true >"$tmp/out" 2>&1
grep -q '^0 passed, [0-9]* failed$' "$tmp/out" || complain "level 0: no answer"
grep -q '^FAIL good.*, not -13$' "$tmp/out" || complain "level 0: no good file"
grep -q '^FAIL segment.4 .*, not -13$' "$tmp/out" ||
    complain "level 0: no damaged file"
verdict level

conform 2 "" ; conform 2 "" /no/such/decoder
verdict usage
all_passed
