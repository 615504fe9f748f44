# SPDX-License-Identifier: MIT
#
# Plots rate and distortion of the variants, and rate and time against the
# number of slots. Set: folder (with curves.dat, slots.dat), out.
set terminal svg size 900,480 font "sans-serif,11" background "white"
set output out
set multiplot layout 1,2
set key below
set grid
set logscale x
set xlabel "file, kB"
set ylabel "PSNR of the training views, dB"
plot for [i=0:*] folder."/curves.dat" index i using 1:2 \
    with linespoints title columnheader(1)
set logscale x 2
set xlabel "slots of the bank"
set ylabel "rate against no bank, %"
set y2label "decoding the segment, ms"
set ytics nomirror
set y2tics
set xrange [16:1024]
plot 0 linetype 0 notitle, \
    folder."/slots.dat" using 1:2 with linespoints title "rate", \
    folder."/slots.dat" using 1:3 axes x1y2 with linespoints title "time"
unset multiplot
