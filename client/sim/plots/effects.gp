# What each effect adds to a tick, in each scene. `marginal`: effects_marginal.csv; `unit`: instructions, or ns where they were
# not counted; `scenes`: their names; `keys`: what a tick takes in them.
n = |scenes|
width = 1100; height = 640 + 24*n
load 'style.gp'
set datafile separator ','
set datafile columnheaders
set datafile missing NaN
stats marginal using 'place' nooutput
last = STATS_max
stats marginal using (column('least_'.unit)) nooutput
least = STATS_min < 0 ? 1.15*STATS_min : 0
stats marginal using (column('most_'.unit)) nooutput
most = 1.15*STATS_max
set tmargin at screen 1 - (90.0 + 24*n)/height
set bmargin at screen 70.0/height
set lmargin at screen 0.17
set rmargin at screen 0.97
set label 1 'Only live effects cost: what each adds to a tick' at screen 0.02, 1 - 26.0/height font title_font textcolor rgb title_colour
set label 2 'bar: mean of what it adds to no other effect and to all others, and the range of both; palpation: with the cap on, instead of the needle' \
  at screen 0.02, 1 - 54.0/height font 'DejaVu Sans,11' textcolor rgb '#5f6a73'
set key at screen 0.02, 1 - 66.0/height top left Left reverse nobox noenhanced font 'DejaVu Sans,12'
set xlabel 'added to a tick, '.unit
set grid x
set xrange [least:most]
set yrange [last + 0.6:-0.6]
set style fill solid 0.85 noborder
half = 0.36/n
y(s) = column('place') + 0.8*(s - 0.5*(n + 1))/n
of(s, name) = strcol('scene') eq scenes[s] ? column(name.unit) : NaN
plot marginal using (NaN):'place':ytic(strcol('effect')) with points notitle, \
  for [s = 1:n] marginal using (of(s, 'mean_')):(y(s)):(0):(of(s, 'mean_')):(y(s) - half):(y(s) + half) with boxxyerror lc rgb safe_colour[s] title keys[s], \
  for [s = 1:n] marginal using (of(s, 'mean_')):(y(s)):(of(s, 'least_')):(of(s, 'most_')) with xerrorbars pt 7 ps 0.5 lc rgb text_colour lw 1.6 notitle, \
  for [s = 1:n] marginal using (of(s, 'most_')):(y(s)):(sprintf('%.0f', of(s, 'mean_'))) with labels left offset 0.8,0 font 'DejaVu Sans,11' textcolor rgb text_colour notitle
