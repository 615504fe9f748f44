# SPDX-License-Identifier: MIT
#
# Rate and distortion of every scene. Set: folder (with NAME.dat), scenes, out.
n = words(scenes)
columns = n < 3 ? n : 3
lines = (n + columns - 1) / columns
set terminal svg size 340 * columns, 320 * lines font "sans-serif,11" \
    background "white"
set output out
set multiplot layout lines, columns
set key bottom right
set grid
set logscale x
set xlabel "bytes of all cameras, kB"
set ylabel "PSNR, dB"
do for [i = 1:n] {
    set title word(scenes, i)
    file = folder . "/" . word(scenes, i) . ".dat"
    stats file using 1:2 nooutput
    plot for [k = 0:STATS_blocks - 2] file index k using 1:2 \
        with linespoints title columnheader(1)
}
unset multiplot
