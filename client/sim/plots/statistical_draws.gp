# Insertions drawn by the statistical model, and their law. `data`: blocks `law` (depth in mm; mean, low, high in N) and
# `draw N` (depth in mm, force in N), N = 0 to `draws` - 1; `finding`: the title.
width = 1400; height = 800
load 'style.gp'
set datafile separator "\t"
set label 1 finding at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
set tmargin at screen 0.92
set lmargin at screen 0.075
set rmargin at screen 0.985
set xrange [0:30]
set yrange [0:5.2]
set xlabel 'depth [mm]'
set ylabel 'force on the needle [N]'
set key top left Left reverse
plot data index 'law;' using 1:3:4 with filledcurves fc rgb '#d7e6f2' title 'central 95 % of the law (synthetic numbers)', \
     for [i = 3:draws - 1] '' index sprintf('draw %d;', i) using 1:2 with lines lw 0.8 lc rgb '#707d8790' title (i == 3 ? 'others' : ''), \
     for [i = 0:2] '' index sprintf('draw %d;', i) using 1:2 with lines lw 2.2 lc rgb safe_colour[i + 1] title (i == 0 ? 'three insertions' : ''), \
     '' index 'law;' using 1:2 with lines lw 2.4 dt (9,4) lc rgb safe_colour[7] title 'mean of the law'
