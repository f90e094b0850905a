# The polynomials of an epidural insertion, and the wall that renders their table. `data`: blocks `law`, `wall W`
# (depth in mm, force in N) and `layers` (top, thickness in mm, name); `legend`: of the walls.
width = 1400; height = 800
load 'style.gp'
set datafile separator "\t"
stats data index 'layers;' using 1 nooutput
layers = STATS_records
do for [i = 0:layers - 1] {
  stats data index 'layers;' every ::i::i using (top = $1, thickness = $2, name = strcol(3), 0) nooutput
  at = top + (i == 0 ? 0.75 : 0.5)*thickness
  # a thin layer's name stands upright
  if (thickness < 4) {
    set label 20 + i name at at, graph 0.035 rotate by 90 left front font 'DejaVu Sans,10' textcolor rgb text_colour
  } else {
    set label 20 + i name at at, graph 0.035 center front font 'DejaVu Sans,10' textcolor rgb text_colour
  }
  if (i % 2 == 0) {
    set object i + 1 rectangle from first top, graph 0 to first top + thickness, graph 1 behind fc rgb shade_colour fs solid noborder
  }
}
set label 1 "A needle's measured force rises faster than a haptic device can: the wall's spring is the limit, not the table" \
    at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
set tmargin at screen 0.92
set lmargin at screen 0.075
set rmargin at screen 0.985
set xrange [0:57]
set yrange [0:14]
set xlabel 'depth [mm]'
set ylabel 'force on the needle [N]'
set key top left Left reverse
set arrow 1 from 0,10 to 57,10 nohead ls 6
set label 40 'peak of the Desktop, 10 N' at 32,10.35 center font 'DejaVu Sans,11' textcolor rgb '#7d8790'
plot data index 'law;' using 1:2 with lines lw 2 dt (7,4) lc rgb safe_colour[7] title 'polynomials of porcine epidural insertions', \
     for [i = 1:|legend|] '' index sprintf('wall %d;', i - 1) using 1:2 with lines lw 2.4 lc rgb safe_colour[i] title legend[i]
