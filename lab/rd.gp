# SPDX-License-Identifier: MIT
#
# Plots rate and distortion of every scene. Set: folder (with NAME.dat), scenes,
# their types (a word for each scene, with a digit for the line type of each of
# its curves), out.
n = words(scenes)
columns = n < 3 ? n : 3
lines = (n + columns - 1) / columns
set terminal svg size 340 * columns, 320 * lines font "sans-serif,11" \
    background "white"
set output out
set multiplot layout lines, columns
set key below
set grid
set logscale x
set xlabel "bytes of all cameras, kB"
set ylabel "PSNR, dB"
do for [i = 1:n] {
    set title word(scenes, i)
    file = folder . "/" . word(scenes, i) . ".dat"
    type = word(types, i)
    plot for [k = 0:strlen(type) - 1] file index k using 1:2 \
        with linespoints linetype int(type[k + 1:k + 1]) title columnheader(1)
}
unset multiplot
