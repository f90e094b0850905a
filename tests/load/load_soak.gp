# Memory, handles and database of a server under load and faults. `csv`: samples.csv; `stations`, `cuts` (lost connections),
# `kills`: how many; `streamed_s`: how long; `judged_s`: from when on it is judged; `finding`: ends the title.
set terminal pngcairo size 1200,850 enhanced font 'DejaVu Sans,13' background '#ffffff'
set encoding utf8
set output png
set datafile separator ','
set grid lc rgb '#d8dde3'
set border 3 lc rgb '#606a75'
set tics nomirror
set lmargin 12
set rmargin 4
set key off
set multiplot layout 3,1 title sprintf('%g stations with random faults (%g lost connections, %g kill -9): %s', stations, cuts, kills, finding) font ',13'
set xrange [0:streamed_s/60.0]
judged_min = judged_s/60.0
set arrow 1 from first judged_min, graph 0 to first judged_min, graph 1 nohead dt 3 lc rgb '#606a75'
set label 1 'judged from here' at first judged_min, graph 0.1 offset 0.5,0 tc rgb '#606a75'
set yrange [0:*]
set ylabel "server's memory\n[MiB]"
set key bottom right
plot csv skip 1 using ($1/60):($2/1024) with lines lw 2 lc rgb '#0072b2' title 'resident', \
     csv skip 1 using ($1/60):($9 > 0 ? $9/1024 : NaN) with lines lw 2 lc rgb '#cc79a7' title 'live heap'
set key off
unset label 1
set ylabel 'open handles'
plot csv skip 1 using ($1/60):4 with lines lw 2 lc rgb '#d55e00'
set xlabel 'minutes'
set ylabel "database\n[MB]"
plot csv skip 1 using ($1/60):($8/1e6) with lines lw 2 lc rgb '#009e73'
unset multiplot
