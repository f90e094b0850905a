# Fig. 11: clamping force, inserted length and distance from the trajectory. `csv`, `phases`; `start_s`, `point1_s`,
# `point2_s`, `target_s`: the moments that fig. 10 names; `scene`: what is set by hand.
width = 1200; height = 800
load 'style.gp'
set datafile separator ','
stats csv using 1:2 skip 1 nooutput
from_s = 0; to_s = STATS_max_x
load 'phases.gp'
set multiplot
set lmargin at screen 0.075
set rmargin at screen 0.97
set xrange [from_s:to_s]
set format x ''
set tmargin at screen 0.88
set bmargin at screen 0.45
set yrange [0:1.4*STATS_max_y]
set ylabel '|f_{clamping}| [N]'
set key left center
set label 100 'Clamping force: in, back, change of trajectory, in, out' at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
set label 101 scene at screen 0.5, 0.93 center noenhanced font 'DejaVu Sans,10' textcolor rgb '#5f6a73'
array moment_s[4] = [start_s, point1_s, point2_s, target_s]
do for [i = 1:4] {
  set arrow from moment_s[i], graph 0 to moment_s[i], graph 1 nohead ls 6
  set label word('Start 1 2 target', i) at moment_s[i], graph 0.94 offset 0.5,0 font 'DejaVu Sans Bold,11' textcolor rgb '#1c2329'
}
plot csv using 1:2 skip 1 with lines ls 5 lw 2.4 title 'clamping force', \
     '' using 1:($6 > 0 ? $2 : 1/0) skip 1 with lines lc rgb '#6a1b4d' lw 3.4 title 'trajectory turns'
unset label

set tmargin at screen 0.42
set bmargin at screen 0.1
set format x '%g'
set xlabel 'time [s]'
set ylabel '[mm]'
set yrange [0:62]
set key top right
set ytics 10
plot csv using 1:($4*1000) skip 1 with lines ls 1 title 'inserted length', \
     '' using 1:($3*1000) skip 1 with lines ls 2 dt 1 title 'distance from the trajectory'
unset multiplot
