# The two ways of a stop beside a recorded hold; below it the whole recording with the withdrawal. `data`: blocks
# `recorded`, `means`, `exponential`, `ramp`, `withdrawal` (time in s, force in N); `held_from_s`, `held_to_s`: what was
# held out; `finding`: the title; `legend`: of the three fits.
width = 1500; height = 950
load 'style.gp'
set datafile separator "\t"
set multiplot
set label 1 finding at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
# above: the hold alone, with what was held out
do for [i = 1:|held_from_s|] {
  set object i rectangle from first held_from_s[i], graph 0 to first held_to_s[i], graph 1 behind fc rgb shade_colour fs solid noborder
}
set lmargin at screen 0.075
set rmargin at screen 0.985
set tmargin at screen 0.925
set bmargin at screen 0.50
set xrange [2:10]
set yrange [0.2:0.375]
set ytics 0.05
set ylabel 'force on the needle [N]'
set key top right Left reverse
set label 2 'hold; held out: every second 0.5 s (shaded)' at graph 0.01, 0.06 font 'DejaVu Sans,12' textcolor rgb text_colour front
plot data index 'recorded;' using 1:2 with points pt 7 ps 0.35 lc rgb '#b3bcc4' title 'recorded, digitised', \
     '' index 'means;' using 1:2 with points pt 7 ps 0.8 lc rgb '#20262c' title 'its means over 0.1 s', \
     '' index 'exponential;' using 1:2 with lines lw 2.6 lc rgb safe_colour[1] title legend[1], \
     '' index 'ramp;' using 1:2 with lines lw 2.6 dt (9,4) lc rgb safe_colour[2] title legend[2]
# below: the whole recording
unset object
unset label
set tmargin at screen 0.42
set bmargin at screen 0.08
set xrange [0:12]
set yrange [-0.2:0.55]
set ytics 0.1
set xlabel 'time [s]'
set arrow 1 from 0,0 to 12,0 nohead ls 6
set label 3 'insertion' at 0.6,0.42 center
set label 4 'hold' at 5.5,0.36 center
set label 5 'withdrawal' at 10.9,0.42 center
plot data index 'recorded;' using 1:2 with points pt 7 ps 0.3 lc rgb '#9aa4ad' notitle, \
     '' index 'exponential;' using 1:2 with lines lw 2.4 lc rgb safe_colour[1] notitle, \
     '' index 'withdrawal;' using 1:2 with lines lw 2.4 lc rgb safe_colour[3] title legend[3]
unset multiplot
