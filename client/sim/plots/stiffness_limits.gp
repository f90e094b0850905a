# The largest stable stiffness of each model over rate and delay, a panel a delay. `csv`: stiffness_limits.csv.
width = 1500; height = 1150
load 'style.gp'
load 'models.gp'
set datafile separator ','
has(list, n) = strstrt(list.' ', sprintf(' %d ', n)) > 0
with_number(list, n) = has(list, n) ? list : list.sprintf(' %d', n)
delays = ''
models = ''
stats csv using (delays = with_number(delays, $3), models = with_number(models, $1), $2) skip 1 nooutput
set xrange [0.78*STATS_min:1.3*STATS_max]
stats csv using ($7*(0.5 + $3)/$2) skip 1 every ::0::0 nooutput
damping = STATS_max    # b + b_hand
cap = 10000            # the largest stiffness of a profile
set multiplot
set logscale xy
set yrange [150:30000]
set xtics ('250' 250, '500' 500, '1000' 1000, '2000' 2000, '4000' 4000, '10,000' 10000)
set ytics ('200' 200, '500' 500, '1000' 1000, '2000' 2000, '5000' 5000, '10,000' 10000)
unset key
set label 100 'How stiff a wall can be is decided by rate, delay and damping, not by the model' at screen 0.5, 0.975 center font 'DejaVu Sans Bold,17' textcolor rgb title_colour
set label 101 sprintf('largest stiffness K at which a nudge dies out (closed loop, bisection to 2 %%); handle 0.35 kg, b + b_{hand} = %.1f N·s/m, encoder 10 µm', damping) at screen 0.5, 0.945 center font 'DejaVu Sans,12' textcolor rgb '#4a5560'
set datafile missing NaN    # so that the rows between do not break a line
do for [i = 1:words(delays)] {
  delay = word(delays, i) + 0
  left = i % 2 == 1
  top = i <= 2
  set lmargin at screen (left ? 0.085 : 0.57)
  set rmargin at screen (left ? 0.505 : 0.985)
  set bmargin at screen (top ? 0.575 : 0.17)
  set tmargin at screen (top ? 0.915 : 0.51)
  set ylabel (left ? 'largest stable stiffness K [N/m]' : '')
  set xlabel (top ? '' : 'rate of the haptic loop 1/T [Hz]')
  set label 1 sprintf('delay d = %d tick%s', delay, delay == 1 ? '' : 's') at graph 0.03, 0.94 left font 'DejaVu Sans Bold,13' textcolor rgb title_colour
  set label 2 'largest K of a profile: stable there too' at graph 0.03, first cap*1.16 left font 'DejaVu Sans,10' textcolor rgb '#7d8790'
  set arrow 1 from graph 0, first cap to graph 1, first cap nohead ls 6
  set label 3 'line: K = (b + b_{hand}) / (T (½ + d))' at graph 0.97, 0.14 right font 'DejaVu Sans,12' textcolor rgb text_colour
  if (has(models, voigt)) {
    set label 4 'dashed: the exact loop with Voigt’s own damper' at graph 0.97, 0.07 right font 'DejaVu Sans,12' textcolor rgb '#A8437F'
  }
  # the lines first, then the marks, side by side
  plot damping*x/(0.5 + delay) with lines lc rgb text_colour lw 2.2, \
       csv using 2:($1 == voigt && $3 == delay ? $8 : NaN) skip 1 with lines lc rgb '#CC79A7' lw 2 dt (8,5), \
       for [m = 0:|model_point| - 1] csv using ($1 == m && $3 == delay ? $2*1.032**(m - |model_point|/2) : NaN):4 skip 1 \
           with points pt model_point[m + 1] ps 1.35 lw 1.8 lc rgb model_colour[m + 1]
  unset label 100
  unset label 101
}
# the key, below all
unset label
unset arrow
unset logscale
unset border
unset tics
unset xlabel
unset ylabel
set lmargin at screen 0.02
set rmargin at screen 0.98
set bmargin at screen 0.005
set tmargin at screen 0.1
set xrange [0:1]
set yrange [0:1]
set key at graph 0.5, 0.95 center top horizontal Left reverse maxcols 5 width 2 nobox samplen 1.2
plot NaN notitle, \
     for [k = 1:words(models)] NaN with points pt model_point[word(models, k) + 1] ps 1.35 lw 1.8 lc rgb model_colour[word(models, k) + 1] \
         title model_name[word(models, k) + 1]
unset multiplot
