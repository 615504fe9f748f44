#!/bin/sh
# SPDX-License-Identifier: MIT
#
# Stands for ffmpeg and ffprobe in the tiers of tests (run_tests.sh), under
# their names in a folder before theirs in PATH. A start of either takes a
# quarter of a second, and tests read the same small videos many times. What the
# real program has printed for the same words and the same bytes of the one file
# that it reads is printed again, without starting it. Everything else runs the
# real program: what fails or warns, what writes files, and what reads none.
set -u
dir=${0%/*} name=${0##*/}
PATH=${PATH%%"$dir:"*}${PATH#*"$dir:"}
words=$name path='' last=''
for word; do
    case $word in
    file:*) words="$words .${word##*.}" path=$path${word#file:} ;;
    *) words="$words $word" ;;
    esac
    last=$word
done
# ffmpeg prints if its last word is "-". Two paths make none that exists.
case $name$last in ffprobe* | ffmpeg-) ;; *) exec "$name" "$@" ;; esac
[ -f "$path" ] || exec "$name" "$@"
key=$({ echo "$words"; cat "$path"; } | md5sum)
kept=$dir/kept/${key%% *}
if [ ! -f "$kept" ]; then
    "$name" "$@" >"$kept.$$" 2>"$kept.$$.log"
    status=$?
    if [ $status != 0 ] || [ -s "$kept.$$.log" ]; then
        cat "$kept.$$"
        cat "$kept.$$.log" >&2
        rm "$kept.$$" "$kept.$$.log"
        exit $status
    fi
    rm "$kept.$$.log"
    mv "$kept.$$" "$kept"
fi
exec cat "$kept"
