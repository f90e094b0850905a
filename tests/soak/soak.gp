# Memory, latencies, missed ticks and spool of a soak. `samples`, `minutes`: the two CSVs; `seconds`, `rate_hz`: of the run;
# `warm_up_s`: judged from then on; `minute_s`: length of a row of `minutes`; `finding`: ends the title. Arrays with an entry
# for each program: `names`, and `base_kib`, its memory after the warm-up.
set terminal pngcairo size 1200,950 enhanced font 'DejaVu Sans,13' background '#ffffff'
set encoding utf8
set output png
set datafile separator ','
set grid lc rgb '#d8dde3'
set border 3 lc rgb '#606a75'
set tics nomirror
set lmargin 13
set rmargin 32
set key outside right top samplen 2
duration = seconds >= 120 ? sprintf('%.0f minutes', seconds/60.0) : sprintf('%.0f seconds', seconds)
set multiplot layout 3,1 title sprintf('%s at %g Hz with recording, uplink and a viewer: %s', duration, rate_hz, finding) font ',14'
set xrange [0:seconds/60.0]
# growth since the warm-up's end: the programs' own sizes differ too much for one axis
set ylabel "memory since the\nwarm-up [KiB]"
judged_min = warm_up_s/60.0
set arrow 1 from first judged_min, graph 0 to first judged_min, graph 1 nohead dt 3 lc rgb '#606a75'
set label 1 'judged from here' at first judged_min, graph 0.08 offset 0.5,0 tc rgb '#606a75'
array colours[3] = ['#0072b2', '#d55e00', '#009e73']
array dashes[3] = [1, 2, 4]
# five columns a program
plot for [i = 1:|names|] samples skip 1 using ($1/60):(column(5*i - 3) - base_kib[i]) with lines lw 2 dt dashes[i] lc rgb colours[i] \
     title sprintf('%s (%.0f MiB)', names[i], base_kib[i]/1024.0)
unset arrow 1
unset label 1
set ylabel 'p99 of each minute'
set logscale y
plot minutes skip 1 using ($1/60):($4/1000) with linespoints lw 2 pt 7 ps 0.5 lc rgb '#d55e00' title 'work of a tick [ms]', \
     '' skip 1 using ($1/60):6 with linespoints lw 2 dt 2 pt 5 ps 0.5 lc rgb '#0072b2' title 'answer of the server [ms]', \
     '' skip 1 using ($1/60):7 with linespoints lw 2 dt 4 pt 9 ps 0.5 lc rgb '#009e73' title 'capture to viewer [ms]'
unset logscale y
set xlabel 'time [min]'
set ylabel "missed ticks\na minute"
set yrange [0:*]
set y2label 'spool [MB]'
set y2range [0:*]
set border 11
set y2tics
plot minutes skip 1 using (($1 - minute_s/2.0)/60):3 with impulses lw 3 lc rgb '#cc79a7' title 'missed ticks (left)', \
     samples skip 1 using ($1/60):($17/1e6) axes x1y2 with lines lw 2 lc rgb '#56b4e9' title 'spool (right)'
unset multiplot
