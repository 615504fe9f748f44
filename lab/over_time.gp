# SPDX-License-Identifier: MIT
#
# Plots the PSNR of a file frame by frame, with and without a base, from the CSV
# files of lab/seams.sh:
#   gnuplot -e "base='a.csv'; none='b.csv'; fps=24; out='x.svg'" lab/over_time.gp
set terminal svg size 800,420 font 'sans-serif,12' background rgb 'white'
set output out
set datafile separator ','
set xlabel 'seconds'
set ylabel 'PSNR of all cameras, dB'
set xtics 1
set grid xtics ytics lc rgb '#dddddd'
set key bottom right
plot base using ($1 / fps):2 with lines lw 2 lc rgb '#0066aa' \
         title 'with a base', \
     none using ($1 / fps):2 with lines lw 2 lc rgb '#cc5500' \
         title 'without'
