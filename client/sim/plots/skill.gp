# Which measures tell novices from experts, and which way. `csv`: skill.csv, effects towards the better end; `finding`: the title.
set datafile separator ','
# column 5: 0 does not separate, 1 towards the better end, 2 the other way, 3 no better end (skill_study.h, Separation)
array measures[4]
do for [k = 0:3] {
  stats csv using ($5 == k ? 1 : 0) skip 1 nooutput
  measures[k + 1] = STATS_sum
}
rows = STATS_records
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
set xlabel "Hedges' g of experts against novices, towards the better end; 95 % bootstrap interval (cut at the edge)" font 'DejaVu Sans,11' offset 0,0.5
set xtics font 'DejaVu Sans,10'
set xrange [-most:most]
set yrange [0:rows + 2]
set ytics noenhanced font 'DejaVu Sans,9'
unset grid
set grid x lc rgb '#dde1e4'
set arrow 1 from 0, graph 0 to 0, graph 1 nohead lc rgb '#7d8790'
# the side where experts are further from the better end
set object 1 rectangle from first -most, graph 0 to first 0, graph 1 behind fc rgb '#f7efe9' fs solid noborder
set label 1 '← experts worse' at graph 0.01, graph 0.985 font 'DejaVu Sans,10' textcolor rgb safe_colour[2]
set label 2 'experts better →' at graph 0.99, graph 0.985 right font 'DejaVu Sans,10' textcolor rgb safe_colour[1]
set key nobox noopaque below center horizontal maxcols 2 font 'DejaVu Sans,10'
set bmargin 5
array mark[4] = [6, 7, 9, 5]
array colour[4] = ['#7d8790', safe_colour[1], safe_colour[2], safe_colour[3]]
array name[4] = ['does not separate', 'separates: experts better', 'separates: experts worse', 'separates, no better end (right: more)']
of(k) = int(k) + 1
plot csv using (0):1:ytic(6) skip 1 with points pt 7 ps 0 notitle, \
     for [k in '1 2 3 0'] csv using ($5 == int(k) ? held($2) : NaN):1:(held($3)):(held($4)) skip 1 with xerrorbars \
         pt mark[of(k)] ps 1.1 lw 1.5 lc rgb colour[of(k)] title (measures[of(k)] > 0 ? name[of(k)] : '')
