# Fig. 8: tip and wall along each axis of the device. `csv`, `phases`, `scene`: what is set by hand.
width = 1200; height = 1000
load 'style.gp'
set datafile separator ','
from_s = -0.25; to_s = 1.75
load 'phases.gp'
array low[3]
array high[3]
do for [a = 1:3] {
  stats csv using (column(1 + a)*1000) skip 1 nooutput
  low[a] = STATS_min - 0.12*(STATS_max - STATS_min)
  high[a] = STATS_max + 0.12*(STATS_max - STATS_min)
}
set multiplot
set xrange [from_s:to_s]
set xtics 0.25
set lmargin at screen 0.085
set rmargin at screen 0.97
set format x ''
set label 100 'Enhanced tracking wall in 3 DoF: needle tip and wall along each axis of the device' at screen 0.5, 0.975 center font title_font textcolor rgb title_colour
set label 101 scene at screen 0.5, 0.95 center noenhanced font 'DejaVu Sans,10' textcolor rgb '#5f6a73'
set key bottom right
do for [a = 1:3] {
  top = 0.91 - 0.285*(a - 1)
  set tmargin at screen top
  set bmargin at screen top - 0.255
  set ylabel word('x y z', a).' [mm]'
  set yrange [low[a]:high[a]]
  set ytics 10
  if (a == 3) { set format x '%g'; set xlabel 'time [s]' }
  plot csv using 1:(column(1 + a)*1000) skip 1 with lines ls 1 title 'needle tip', \
       '' using 1:(column(4 + a)*1000) skip 1 with lines ls 2 title 'wall ω_n'
  unset label
  unset key
}
unset multiplot
