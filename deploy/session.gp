# A recorded session as a picture. usage: gnuplot -e "csv='session.csv'; png='session.png'" deploy/session.gp
# `hand`, if given, says whose hand it was: "simulated hand, no person".
if (!exists('hand')) hand = ''
set terminal pngcairo size 1200,900 font 'DejaVu Sans,11'
set output png
set datafile separator ','
set key outside right top samplen 2
set grid lc rgb '#d8dde3'
set border 3 lc rgb '#606a75'
set tics nomirror
set lmargin 11
set rmargin 22
# each axis spans at least as much as in the windows' plots (client/view/model/plot.cpp), so that noise looks like noise
least_depth_mm = 10
least_force_N = 2
do for [axis in 'x y z'] { stats csv using (column('p'.axis.'_m')*1e3) name axis nooutput }
low = x_min < y_min ? x_min : y_min
low = z_min < low ? z_min : low
high = x_max > y_max ? x_max : y_max
high = z_max > high ? z_max : high
missing = least_depth_mm - (high - low)
if (missing > 0) { low = low - missing/2; high = high + missing/2 }
set multiplot layout 3,1 title (strlen(hand) > 0 ? 'A recorded insertion: '.hand : 'A recorded insertion') noenhanced font 'DejaVu Sans,15'
set xlabel ''
set ylabel 'inserted length [mm]'
set yrange [*<0:least_depth_mm<*]
plot csv using 't_s':(column('insertion_m')*1e3) with lines lw 2 lc rgb '#1b6ca8' title 'insertion', \
     csv using 't_s':(column('lateral_error_m')*1e3) with lines lw 1.5 lc rgb '#d1495b' title 'from its own line'
set ylabel 'force on the hand [N]'
set yrange [*<0:least_force_N<*]
plot csv using 't_s':'fx_n' with lines lw 1.3 lc rgb '#d1495b' title 'x', \
     csv using 't_s':'fy_n' with lines lw 1.3 lc rgb '#66a182' title 'y', \
     csv using 't_s':'fz_n' with lines lw 1.3 lc rgb '#1b6ca8' title 'z', \
     csv using 't_s':(sqrt(column('fx_n')**2+column('fy_n')**2+column('fz_n')**2)) with lines lw 2 lc rgb '#2e4057' title 'magnitude'
set ylabel 'tip [mm]'
set yrange [*<low:high<*]
set xlabel 'time [s]'
plot csv using 't_s':(column('px_m')*1e3) with lines lw 1.3 lc rgb '#d1495b' title 'x', \
     csv using 't_s':(column('py_m')*1e3) with lines lw 1.3 lc rgb '#66a182' title 'y', \
     csv using 't_s':(column('pz_m')*1e3) with lines lw 1.3 lc rgb '#1b6ca8' title 'z', \
     csv using 't_s':(column('wz_m')*1e3) with lines lw 1.3 dt 2 lc rgb '#2e4057' title 'wall, z'
unset multiplot
