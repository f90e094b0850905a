# A server from one station to a thousand, in four panels over the number of stations. Arrays with an entry for each run:
# `stations`; `server_cores`, `generator_cores`; `live_p50_ms`, `live_p99_ms`; `server_mib`; `database_mb_a_minute`.
# `most`: the largest number of stations; `goal_ms`: of live_p99_ms; `shared_cores`: of the machine; `finding`: ends the title.
set terminal pngcairo size 1300,900 enhanced font 'DejaVu Sans,13' background '#ffffff'
set encoding utf8
set output png
set grid lc rgb '#d8dde3'
set border 3 lc rgb '#606a75'
set tics nomirror
set xrange [0:1.05*most]
set xlabel 'stations'
set key top left Left reverse samplen 2
set lmargin 11
set rmargin 3
set multiplot layout 2,2 title sprintf('%g stations at 1 kHz over TLS on %g shared cores: %s', most, shared_cores, finding) font ',14'
# of an array, column 1 is the index and column 2 the value
set yrange [0:*]
set ylabel 'processor [cores]'
plot stations using 2:(server_cores[$1]) with linespoints lw 2 ps 1.2 pt 7 lc rgb '#0072b2' title 'server', \
     stations using 2:(generator_cores[$1]) with linespoints lw 2 ps 1.2 pt 5 lc rgb '#d55e00' title 'generator (stations and viewers)'
set ylabel 'capture to viewer [ms]'
set yrange [0:*<200]
plot goal_ms with lines dt 2 lw 2 lc rgb '#606a75' title 'goal for p99', \
     stations using 2:(live_p99_ms[$1]) with linespoints lw 2 ps 1.2 pt 7 lc rgb '#d55e00' title 'p99', \
     stations using 2:(live_p50_ms[$1]) with linespoints lw 2 ps 1.2 pt 5 lc rgb '#0072b2' title 'p50'
set key off
set yrange [0:*]
set ylabel 'memory of the server [MiB]'
plot stations using 2:(server_mib[$1]) with linespoints lw 2 ps 1.2 pt 7 lc rgb '#0072b2'
set ylabel 'database [MB a minute]'
plot stations using 2:(database_mb_a_minute[$1]) with linespoints lw 2 ps 1.2 pt 7 lc rgb '#009e73'
unset multiplot
