# SPDX-License-Identifier: MIT
#
# Plots the course of a training from the log of `saga encode --log FILE.csv`.
# Set: log, out (an SVG), for example
#   gnuplot -e "log = 'x.csv'; out = 'x.svg'" lab/log.gp
set terminal svg size 680, 340 font "sans-serif,11" background "white"
set output out
set datafile separator ","
set key bottom right
set grid
set xlabel "iteration"
set ylabel "PSNR of recent training pictures, dB"
set y2label "residuals, kB"
set ytics nomirror
set y2tics
set y2range [0:*]
plot log using 1:(column("psnr") > 0 ? column("psnr") : NaN) with lines \
        title "PSNR", \
    log using 1:(column("bits") > 0 ? column("bits") / 8e3 : NaN) axes x1y2 \
        with lines title "residuals"
