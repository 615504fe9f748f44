#!/bin/bash
# SPDX-License-Identifier: MIT
#
# verdict.sh: what check scripts say, to be sourced by bash. `checks` names the
# script in its lines. Sets `tmp`, a folder that goes when the script ends, and
# `bad` in it, the file that collects complaints.
#   complain TEXT...   something is wrong
#   verdict NAME       one line: ok if nobody complained since the last verdict,
#                      else FAIL after the complaints
#   all_passed         the sums; status 1 if any verdict was FAIL
#   expect STATUS ARGUMENTS...  runs `run_as`; its output is in $tmp/out, its
#                      messages in $tmp/err
#   says TEXT          the messages are one line that has it; no output
#   told STATUS TEXT ARGUMENTS...  both
#   $stoppable ...     runs a program that SIGINT reaches: whoever starts us in
#                      the background may have it ignored, for good
# shellcheck disable=SC2154,SC2034
passed=0
failed=0
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
bad=$tmp/bad
stoppable='env --default-signal=INT'
: >"$bad"

complain() { echo "$*" >>"$bad"; }

verdict() {
    if [ -s "$bad" ]; then
        sed 's/^/     /' "$bad"
        echo "FAIL $checks $1"
        failed=$((failed + 1))
    else
        echo "ok   $checks $1"
        passed=$((passed + 1))
    fi
    : >"$bad"
}

expect() {
    local want=$1 rc
    shift
    "${run_as[@]}" "$@" >"$tmp/out" 2>"$tmp/err" </dev/null
    rc=$?
    [ "$rc" = "$want" ] || complain \
        "${run_as[*]} $*: status $rc, not $want: $(tail -n 1 "$tmp/err")"
}

says() {
    [ "$(wc -l <"$tmp/err")" = 1 ] ||
        complain "not one line of message: $(cat "$tmp/err")"
    grep -qF -e "$1" "$tmp/err" || complain "no '$1' in: $(cat "$tmp/err")"
    [ ! -s "$tmp/out" ] || complain "output beside: $(cat "$tmp/err")"
}

told() {
    local status=$1 text=$2
    shift 2
    expect "$status" "$@"
    says "$text"
}

all_passed() {
    echo "$checks: $passed passed, $failed failed"
    [ "$failed" = 0 ]
}
