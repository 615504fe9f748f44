#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_windows.sh: guarantees, for the programs of `make windows` under Wine,
#   libraries   they need no library but Windows' own
#   pixels      they draw the pixels of saga-dec and saga-play, also to a pipe,
#               where no byte becomes two
#   names       file names in UTF-8 are read and written
#   whole       a picture replaces an older one; after a failure the old one is
#               there and no part; a part that a killed writer has left goes,
#               one that is open stays
#   messages    a missing file, and one that may not be replaced, are named
# shellcheck disable=SC2034,SC2154,SC1091
set -u
cd "$(dirname "$0")/../.." || exit
checks=windows
. tests/cli/verdict.sh

out=${BUILD:-build}
dec=${SAGA_DEC:-$out/saga-dec}
there=$(realpath -m "$out")/windows
film=$PWD/vectors/good/motion.saga
export WINEPREFIX=$there/wine WINEDEBUG=-all LC_ALL=C.UTF-8

"${MAKE:-make}" -s BUILD="$out" windows >"$tmp/make" 2>&1 ||
    complain "make windows: $(tail -n 3 "$tmp/make")"
for p in saga-dec saga-play; do
    x86_64-w64-mingw32-objdump -p "$there/$p.exe" |
        sed -n 's/.*DLL Name: //p' | grep -vixE 'kernel32.dll|msvcrt.dll' >>"$bad"
done
verdict libraries

saga_dec() { wine "$there/saga-dec.exe" "$@" 2>"$tmp/err"; }
saga_play() { wine "$there/saga-play.exe" "$@" 2>"$tmp/err"; }
cd "$tmp" || exit

"$OLDPWD/$dec" "$film" --camera 0 --time 3/2 -o want.ppm
"$OLDPWD/$(dirname "$dec")/saga-play" "$film" 2 0 3 --rgb want.rgb 2>err
saga_dec "$film" --camera 0 --time 3/2 -o got.ppm || complain "$(cat err)"
cmp want.ppm got.ppm >>"$bad" 2>&1
saga_play "$film" 2 0 3 --rgb - >got.rgb || complain "$(cat err)"
cmp want.rgb got.rgb >>"$bad" 2>&1
verdict pixels

input=$'G\u00e4nge \u52d5.saga' output=$'Gr\u00f6\u00dfe \u5927.ppm'
cp "$film" "$input"
saga_dec "$input" --camera 0 --time 3/2 -o "$output" || complain "$(cat err)"
cmp want.ppm "$output" >>"$bad" 2>&1
verdict names

echo old >one.ppm
echo stale >one.ppm.saga-part-7-0
echo mine >one.ppm.saga-part-notes
saga_dec "$film" --camera 0 --time 3/2 -o one.ppm || complain "$(cat err)"
cmp want.ppm one.ppm >>"$bad" 2>&1
[ ! -e one.ppm.saga-part-7-0 ] || complain "a killed writer's part is left"
[ -e one.ppm.saga-part-notes ] || complain "another file is removed"
# saga-play notices only while it writes that this film lacks its end.
head -c -64 "$film" >short.saga
echo old >two.rgb
saga_play short.saga 1 0 --rgb two.rgb && complain "a short film is played"
[ "$(cat two.rgb)" = old ] || complain "a failure replaces a file"
# Another program has a part open until it has read a line.
mkfifo line
wine cmd /c 'pause >three.ppm.saga-part-7-0' <line &
exec 3>line
for _ in $(seq 500); do
    [ -e three.ppm.saga-part-7-0 ] && break
    sleep 0.02
done
saga_dec "$film" --camera 0 --time 3/2 -o three.ppm || complain "$(cat err)"
[ -e three.ppm.saga-part-7-0 ] || complain "a living writer's part is removed"
echo >&3
exec 3>&-
wait
saga_dec "$film" --camera 0 --time 3/2 -o three.ppm || complain "$(cat err)"
cmp want.ppm three.ppm >>"$bad" 2>&1
[ -z "$(find . -name '*-part-[0-9]*')" ] || complain "parts are left: $(ls)"
verdict whole


run_as=(wine "$there/saga-dec.exe")
told 2 'gone.saga: cannot open: No such file' gone.saga --info
mkdir folder
told 2 'folder: cannot write: ' "$film" --camera 0 -o folder
expect 0 "$film" --camera 0 -o NUL
verdict messages

all_passed
