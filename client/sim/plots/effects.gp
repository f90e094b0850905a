# What a tick costs with each set of live effects, and what each effect adds. `csv`: effects.csv; `marginal`:
# effects_marginal.csv; `unit`: instructions, or ns where they were not counted; `of_none`, `of_all`: without effects, and
# with the costliest set.
width = 1400; height = 640
load 'style.gp'
set datafile separator ','
stats csv using 1 skip 1 nooutput
sets = STATS_records
stats marginal using 3 skip 1 nooutput
least_more = STATS_min < 0 ? 1.15*STATS_min : 0
stats marginal using 4 skip 1 nooutput
most_more = 1.15*STATS_max
effects = STATS_records
set multiplot layout 1,2 title sprintf('Only live effects cost: a tick takes %.0f %s with none and %.0f with the costliest set', of_none, unit, of_all) font ',15'
# left: every set
set lmargin 9
set rmargin 3
set bmargin 5
set tmargin 5
set title 'all sets, from the cheapest on' font ',13'
set xlabel 'sets of live effects'
set ylabel 'one tick, '.unit
set yrange [0:*]
set xrange [0:sets + 1]
set grid y
set key top left Left reverse
plot csv skip 1 using 1:3 with points pt 7 ps 1.1 lc rgb '#1f5fa8' title (unit eq 'ns' ? 'median' : 'mean over a gesture: the same in each run')
# right: what each adds
set title 'what each effect adds: mean, range over its pairs' font ',13'
set xlabel 'added to a tick, '.unit
unset ylabel
set lmargin 20
unset key
set grid x
set xrange [least_more:most_more]
set yrange [effects - 0.4:-0.6]
set ytics ()
set boxwidth 0.55
set style fill solid 0.85 noborder
plot marginal skip 1 using 2:1:(0):2:($1 - 0.28):($1 + 0.28):ytic(5) with boxxyerror lc rgb '#1f5fa8', \
     '' skip 1 using 2:1:3:4 with xerrorbars pt 7 ps 0.6 lc rgb '#e07b1f' lw 2
unset multiplot
