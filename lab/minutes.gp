# SPDX-License-Identifier: MIT
#
# Plots PSNR against minutes, a curve for each log of `saga encode --log
# FILE.csv`, named after its file. Set: logs, out (an SVG), for example
#   gnuplot -e "logs = 'fast.csv best.csv'; out = 'minutes.svg'" lab/minutes.gp
set terminal svg size 680, 340 font "sans-serif,11" background "white"
set output out
set datafile separator ","
set key bottom right
set grid
set logscale x
set xlabel "minutes"
set ylabel "PSNR of recent training pictures, dB"
set yrange [22:*]
name(log) = system("basename -s .csv '" . log . "'")
plot for [log in logs] log every 4 \
    using (column("seconds") / 60):(column("psnr") > 0 ? column("psnr") : NaN) \
    with lines title name(log)
