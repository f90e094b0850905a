# Fig. 7: position, speed and force along z. `csv`, `phases`.
width = 1200; height = 1000
load 'style.gp'
set datafile separator ','
from_s = 22; to_s = 33
load 'phases.gp'
set multiplot
set xrange [from_s:to_s]
set lmargin at screen 0.085
set rmargin at screen 0.97
set format x ''
set label 100 'Enhanced tracking wall in 1 DoF: 1 N in, decay in the stop, 0.5 N out' at screen 0.5, 0.975 center font title_font textcolor rgb title_colour

set tmargin at screen 0.91
set bmargin at screen 0.635
set ylabel 'position z [mm]' offset 0.5,0
set yrange [-36:26]
set ytics 10
set key bottom left
set arrow 1 from from_s,0 to to_s,0 nohead ls 6
set label 101 'skin' at 22.12,2.6 font 'DejaVu Sans,10' textcolor rgb '#7d8790'
plot csv using 1:($2*1000) skip 1 with lines ls 1 title 'needle tip', \
     '' using 1:($3*1000) skip 1 with lines ls 2 title 'wall ω_n'
unset label

set tmargin at screen 0.605
set bmargin at screen 0.39
set ylabel 'speed v_z [mm/s]'
set yrange [-50:45]
set ytics 20
set key top left
plot csv using 1:($4*1000) skip 1 with lines ls 1 title 'needle tip'

set tmargin at screen 0.36
set bmargin at screen 0.085
set format x '%g'
set xlabel 'time [s]'
set ylabel 'force on the hand f_z [N]'
set yrange [-0.75:1.35]
set ytics 0.5
set key top right
set arrow 2 from from_s,1 to to_s,1 nohead ls 6
set arrow 3 from from_s,-0.5 to to_s,-0.5 nohead ls 6
plot csv using 1:5 skip 1 with lines lc rgb '#4a5560' lw 2 title 'no force', \
     '' using 1:($7 < 0 ? $5 : 1/0) skip 1 with lines ls 3 title 'cutting force', \
     '' using 1:($8 > 0 ? $5 : 1/0) skip 1 with lines ls 4 title 'attracted force'
unset multiplot
