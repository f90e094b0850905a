# Which measures tell novices from experts. `csv`: skill.csv; `finding`: the title.
set datafile separator ','
stats csv using ($5 == 1 ? 1 : 0) skip 1 nooutput
rows = STATS_records
apart = STATS_sum
# the axis holds the estimates; intervals of near-constant measures may run out of it
stats csv using (abs($2) < 1e300 ? abs($2) : 0) skip 1 nooutput
most = ceil(1.25*(STATS_max > 1 ? STATS_max : 1))
held(v) = v > most ? most : v < -most ? -most : v == v ? v : most
width = 1000; height = 240 + 22*rows
load 'style.gp'
set datafile missing '-'
set border 31 lc rgb 'black' lw 1
unset x2tics
unset y2tics
set xtics mirror in scale 1 textcolor rgb 'black'
set ytics mirror in scale 1 textcolor rgb 'black'
# finding and caution in three lines; the finding parts at its semicolon
at = strstrt(finding, '; ')
set title (at > 0 ? finding[1:at]."\n".finding[at + 2:*] : finding)."\n{/DejaVuSans=10 Simulated hands: a check of the machinery, no evidence about people}" font 'DejaVu Sans Bold,12'
set xlabel "Hedges' g, experts against novices (dimensionless), 95 % bootstrap interval (cut at the edge)" font 'DejaVu Sans,11' offset 0,0.5
set xtics font 'DejaVu Sans,10'
set xrange [-most:most]
set yrange [0:rows + 1]
set ytics noenhanced font 'DejaVu Sans,9'
unset grid
set grid x lc rgb '#dde1e4'
set arrow 1 from 0, graph 0 to 0, graph 1 nohead lc rgb '#7d8790'
set key nobox noopaque below center horizontal font 'DejaVu Sans,10'
set bmargin 5
plot csv using (0):1:ytic(6) skip 1 with points pt 7 ps 0 notitle, \
     '' using ($5 == 1 ? held($2) : NaN):1:(held($3)):(held($4)) skip 1 with xerrorbars pt 7 ps 1.1 lw 1.6 lc rgb '#0b5fa5' \
         title (apart > 0 ? 'separates (permutation p ≤ 0.05)' : ''), \
     '' using ($5 == 0 ? held($2) : NaN):1:(held($3)):(held($4)) skip 1 with xerrorbars pt 6 ps 1.1 lw 1.2 lc rgb '#d9822b' \
         title (apart < rows ? 'does not separate' : '')
