# The stiffest wall that stays still at a delay of one tick, of every model without a damper of its own; the line is the theory's.
load 'rule.gp'
csv = folder.'/stiffness_limits.csv'
stats csv using ($3 == 1 ? $7*(0.5 + $3)/$2 : NaN) skip 1 nooutput
damping = STATS_mean
set title 'Hard cases stay stable'
set xlabel 'rate of the loop [Hz]'
set lmargin 12
set ylabel 'stiffest stable wall [N/m]'
set logscale xy
set xrange [200:12000]
set yrange [300:20000]
set xtics ('250' 250, '1000' 1000, '4000' 4000)
set ytics ('500' 500, '1000' 1000, '2000' 2000, '5000' 5000, '10,000' 10000)
set label 1 'unstable' at graph 0.12, 0.8 front textcolor rgb '#c0303b'
set label 2 'stable' at graph 0.68, 0.2 front textcolor rgb '#2a8a4a'
plot damping*x/1.5 with filledcurves x1 fc rgb '#e6f2ea' fs solid noborder, damping*x/1.5 with lines lc rgb text_colour lw 2.5, \
     csv using ($3 == 1 && $5 == 0 && strcol(11) ne 'VOIGT' ? $2 : NaN):4 skip 1 with points pt 7 ps 1.8 lc rgb '#1f5fa8'
