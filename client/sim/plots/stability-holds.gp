# The force of the wall, Voigt and direct in the cases in which they were held still. `csv`: stability-holds.csv; `data`:
# block `panels` (panel, row, column, 1 when still, title of the row, text); `shown_s`: how long.
width = 1300; height = 900
load 'style.gp'
set datafile separator "\t"
stats data index 'panels;' using 1 nooutput
panels = STATS_records
unset key
set multiplot
set label 100 'Held still, the wall gives the hand a still force; a damper or a force step does not' at screen 0.5, 0.965 center font 'DejaVu Sans Bold,15' textcolor rgb title_colour
set label 101 'force less its mean [N]' at screen 0.018, 0.48 center rotate by 90 textcolor rgb text_colour
set label 102 'time in the hold [s]' at screen 0.53, 0.03 center textcolor rgb text_colour
set yrange [-0.7:1.15]
set ytics -0.5, 0.5, 1
set xrange [0:shown_s]
set xtics 0.1
set grid
do for [i = 0:panels - 1] {
  set datafile separator "\t"
  stats data index 'panels;' every ::i::i using (panel = $1, row = $2, column = $3, still = $4, title = strcol(5), caption = strcol(6), 0) nooutput
  line_ink = still == 1 ? '#1f5fa8' : '#e07b1f'
  text_ink = still == 1 ? '#1f5fa8' : '#8a4306'
  left = 0.08 + 0.31*column
  top = 0.86 - 0.275*row
  set lmargin at screen left
  set rmargin at screen left + 0.285
  set tmargin at screen top
  set bmargin at screen top - 0.2
  set format x (row == 2 ? '%g' : '')
  set format y (column == 0 ? '%g' : '')
  set label 1 (column == 0 ? title : '') at screen left, top + 0.022 left font 'DejaVu Sans,12' textcolor rgb '#4a5560'
  set label 2 caption at graph 0.98, 0.1 right font 'DejaVu Sans,11' textcolor rgb text_ink
  set datafile separator ','
  plot csv using ($1 == panel ? $2 : NaN):3 skip 1 with lines lw 1.6 lc rgb line_ink
  unset label 100
  unset label 101
  unset label 102
}
unset multiplot
