# SPDX-License-Identifier: MIT
#
# The plots of `make numerics`. Set: folder (with the tables of
# lab/numerics.py), titles and n_operators (names and number of the operators),
# out (prefix of the pictures).
set style line 1 linecolor rgb "#9aa5b1" pointtype 6 pointsize 0.9
set style line 2 linecolor rgb "#e69f00" pointtype 9 pointsize 1.0
set style line 3 linecolor rgb "#56b4e9" pointtype 4 pointsize 0.9
set style line 4 linecolor rgb "#0072b2" pointtype 7 pointsize 1.0
names = "float64 float32 'integer, plain C' 'integer, vectors'"

# ---- All operators: time at the left, error at the right
set terminal svg size 900,620 font "sans-serif,11" background "white"
set output out.".svg"
set termoption noenhanced
set multiplot
set grid x y linecolor rgb "#e5e5e5"
set yrange [n_operators + 0.6:0.4]
set key at screen 0.5,0.985 center top horizontal samplen 1
set logscale x
set format x "%g"
set xrange [0.05:20000]
set ytics nomirror scale 0
set lmargin at screen 0.2
set rmargin at screen 0.62
set tmargin at screen 0.92
set bmargin at screen 0.1
set xlabel "time of a unit, ns: to the left is faster"
plot for [v=1:4] folder."/operators.dat" index v - 1 \
    using 2:1:3:4:ytic(7) with xerrorbars linestyle v title word(names, v)
unset key
unset logscale x
set lmargin at screen 0.66
set rmargin at screen 0.97
set format y ""
set xrange [8:34]
set xtics 4
set xlabel "right bits of the range: to the right is more exact"
plot folder."/operators.dat" index 1 using 5:1 with points linestyle 2, \
    folder."/operators.dat" index 3 using 5:1 with points linestyle 4
unset multiplot
reset

# ---- A panel for each operator: time against error
set style line 1 linecolor rgb "#9aa5b1" pointtype 6 pointsize 0.8
set style line 2 linecolor rgb "#e69f00" pointtype 9 pointsize 0.9
set style line 3 linecolor rgb "#56b4e9" pointtype 4 pointsize 0.8
set style line 4 linecolor rgb "#0072b2" pointtype 7 pointsize 0.9
set terminal svg size 1000,780 font "sans-serif,10" background "white"
set output out."_points.svg"
columns = 5
set multiplot layout (n_operators + columns) / columns, columns \
    margins 0.06,0.985,0.06,0.955 spacing 0.05,0.075
unset key
set termoption noenhanced
set logscale x
set grid linecolor rgb "#e5e5e5"
set yrange [0:56]
set ytics 14
set offsets graph 0.15, graph 0.15, 0, 0
do for [i = 1:n_operators] {
    set title word(titles, i) offset 0,-0.6
    set xlabel (i > n_operators - columns ? "ns" : "") offset 0,0.6
    set ylabel (i % columns == 1 ? "right bits" : "") offset 1.5,0
    plot for [v=1:4] folder."/operators.dat" index v - 1 \
        using (int($1) == i ? $2 : NaN):(int($1) == i ? $5 : NaN): \
            (int($1) == i ? $3 : NaN):(int($1) == i ? $4 : NaN) \
        with xerrorbars linestyle v
}
set title "" 
unset logscale
set key center
unset tics
unset border
unset grid
set xlabel ""
set ylabel ""
set yrange [0:1]
set xrange [0:1]
plot for [v=1:4] NaN with points linestyle v title word(names, v)
unset multiplot
reset

# ---- Formats: error of the picture against bits
set terminal svg size 900,500 font "sans-serif,11" background "white"
set output out."_formats.svg"
set termoption noenhanced
set multiplot layout 1,2 margins 0.08,0.98,0.43,0.96 spacing 0.1
set grid linecolor rgb "#e5e5e5"
set key below maxrows 4 samplen 2 Left reverse
set logscale y
set format y "%g"
set yrange [0.001:20]
set ylabel "error of the picture, levels of 255 (RMS)"
do for [panel = 1:2] {
    file = folder."/formats_".word("splats networks", panel).".dat"
    set xlabel word("'bits behind the point' 'bits of a number'", panel)
    stats file using 1 nooutput
    set xrange [panel == 1 ? 1 : 5:panel == 1 ? 21 : 23]
    plot 0.2887 linecolor rgb "#999999" dashtype 2 title "8-bit picture", \
        for [i = 0:STATS_blocks - 1] file index i using 1:2 \
            with linespoints linetype i + 1 pointtype 6 pointsize 0.6 \
            title columnheader(1), \
        for [i = 0:STATS_blocks - 1] file index i \
            using 1:(int($3) ? $2 : NaN) with points linetype i + 1 \
            pointtype 7 pointsize 1.2 notitle
}
unset multiplot
