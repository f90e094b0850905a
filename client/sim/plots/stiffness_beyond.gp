# The swing of each model with half as much stiffness again as is stable, a panel a model. `csv`: stiffness_beyond.csv;
# `rate_hz`, `delay_ticks`; an entry a model in `model`, `stiffness_n_per_m`, `swing_n` (peak-to-peak), `max_force_n`.
width = 1500; height = 1050
load 'style.gp'
load 'models.gp'
set datafile separator ','
set multiplot
unset key
set xrange [-0.1:1.5]
set label 100 'Half as stiff again as is stable: the swing grows to all the force that a model can give' at screen 0.5, 0.975 center font 'DejaVu Sans Bold,17' textcolor rgb title_colour
set label 101 sprintf('force after a nudge at 1.5 × each model''s own limit, %.0f Hz, %d tick late, tissue of 1 N on the way in and 0.5 N on the way out; dashed: these forces', rate_hz, delay_ticks) at screen 0.5, 0.945 center font 'DejaVu Sans,12' textcolor rgb '#4a5560'
set ytics 1
set arrow 1 from graph 0, first 1 to graph 1, first 1 nohead ls 6 front
set arrow 2 from graph 0, first -0.5 to graph 1, first -0.5 nohead ls 6 front
columns = 3
panels = |model|
lines = (panels + columns - 1)/columns
panel_width = 0.945/columns
panel_height = 0.86/lines
do for [i = 1:panels] {
  column = (i - 1) % columns
  left = 0.05 + panel_width*column
  top = 0.925 - panel_height*((i - 1)/columns)
  set lmargin at screen left + 0.012
  set rmargin at screen left + panel_width - 0.012
  set bmargin at screen top - panel_height + 0.045
  set tmargin at screen top - 0.03
  set yrange [-1.2:(max_force_n[i] > 1.6 ? 4 : 2)]
  set ylabel (column == 0 ? 'resistance [N]' : '') offset 1,0
  set xlabel (i + columns > panels ? 'time after the nudge [s]' : '')
  swing = swing_n[i] > 0 ? sprintf('%.1f N peak-to-peak', swing_n[i]) : 'let the needle through'
  set label 1 sprintf('%s, %.0f N/m: %s', model_name[model[i] + 1], stiffness_n_per_m[i], swing) at graph 0.5, 1.06 center font 'DejaVu Sans,11' textcolor rgb title_colour
  plot csv using ($1 == model[i] ? $2 : NaN):3 skip 1 with lines lw 1.2 lc rgb model_colour[model[i] + 1]
  unset label 100
  unset label 101
}
unset multiplot
