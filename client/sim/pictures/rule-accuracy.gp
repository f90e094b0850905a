# What accuracy costs: a faster loop is nearer to the law, and takes more of the computer's time.
load 'rule.gp'
csv = folder.'/accuracy.csv'
model = 'ENHANCED_TRACKING_WALL'
encoder_m = 1e-5
# the tick's time, measured at 1 kHz
tick_ns = 0
stats csv using (strcol('comparator') eq 'cost' && strcol('model') eq model ? tick_ns = column('p50_ns') : 0) nooutput
is(rate) = strcol('comparator') eq 'verification' && strcol('model') eq model && strcol('variant') eq '' && abs(column('encoder_m')/encoder_m - 1) < 1e-6
x() = 1e-6*tick_ns*column('rate_hz')
y() = 1e3*column('error_n')
set title 'Accuracy has a price in time'
set xlabel 'computer time in a second [ms]'
set ylabel 'error of the force [mN]'
set logscale xy
set xrange [0.2:20]
set yrange [1:30]
plot csv skip 0 using (is(0) ? x() : NaN):(y()):(1e3*column('error_low_n')):(1e3*column('error_high_n')) with yerrorbars ls 1 pt 7 ps 2, \
     '' using (is(0) ? x() : NaN):(y()):(sprintf('%g Hz', column('rate_hz'))) with labels left offset 1.2,0.6
