# What accuracy costs: a faster loop is nearer to the law, and takes more of the computer's time.
load 'rule.gp'
set datafile columnheaders
csv = folder.'/accuracy.csv'
model = 'ENHANCED_TRACKING_WALL'
encoder_m = 1e-5
# a tick's instructions do not depend on the loop's rate
stats csv using (strcol('model') eq model && strcol('comparator') eq 'verification' ? column('instructions') : NaN) nooutput
of_tick = STATS_mean
is(u) = strcol('comparator') eq 'verification' && strcol('model') eq model && abs(column('encoder_m')/encoder_m - 1) < 1e-6
x(u) = is(u) ? 1e-6*of_tick*column('rate_hz') : NaN
set title 'Accuracy has a price in time'
set xlabel 'million instructions a second'
set ylabel 'error between jumps [mN]'
set logscale xy
set xrange [0.04:4]
set yrange [1:40]
set arrow from graph 0, first 20.8 to graph 1, first 20.8 nohead lw 2 dt (6,4) lc rgb '#c0303b'
set label 'a hand notices 20.8' at graph 0.98, first 20.8 right offset 0,0.7 textcolor rgb '#c0303b'
plot csv using (x(0)):(1e3*column('error_n')):(1e3*column('error_low_n')):(1e3*column('error_high_n')) with yerrorbars ls 1 pt 7 ps 2, \
     '' using (x(0)):(1e3*column('error_n')):(sprintf('%g Hz', column('rate_hz'))) with labels left offset 1.2,0.6
