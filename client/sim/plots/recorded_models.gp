# Every model fitted to a recorded force-depth curve, a panel a model. `data`: blocks `fitted`, `heldout` and `model M`
# (depth in mm, force in N); `names`, `errors`: texts above the panels; `finding`: the title.
width = 1800; height = 1000
load 'style.gp'
set datafile separator "\t"
set multiplot
set xrange [0:48]
set yrange [-0.15:2.6]
set xtics 10
set ytics 0.5
unset key
set label 10 finding at screen 0.5, 0.968 center font title_font textcolor rgb title_colour
set label 11 'grey: recorded, fitted on; orange: recorded, held out (every second 0.5 mm); blue: the engine with the fitted scene; rms error on what was held out' \
    at screen 0.5, 0.935 center font 'DejaVu Sans,12' textcolor rgb text_colour
columns = 5
lines = (|names| + columns - 1)/columns
do for [m = 0:|names| - 1] {
  left = 0.045 + 0.19*(m % columns)
  top = 0.86 - 0.43*(m/columns)
  set lmargin at screen left
  set rmargin at screen left + 0.17
  set tmargin at screen top
  set bmargin at screen top - 0.335
  set ylabel (m % columns == 0 ? 'force [N]' : '') offset 1,0
  set format y (m % columns == 0 ? '%g' : '')
  set xlabel (m/columns == lines - 1 ? 'depth [mm]' : '')
  set label 1 names[m + 1] at graph 0.5, 1.10 center font 'DejaVu Sans Bold,12' textcolor rgb title_colour
  set label 2 errors[m + 1] at graph 0.5, 1.035 center font 'DejaVu Sans,11' textcolor rgb text_colour
  plot data index 'fitted;' using 1:2 with points pt 7 ps 0.3 lc rgb '#9aa4ad', \
       '' index 'heldout;' using 1:2 with points pt 7 ps 0.35 lc rgb safe_colour[2], \
       '' index sprintf('model %d;', m) using 1:2 with lines lw 2 lc rgb safe_colour[1]
  unset label
}
unset multiplot
