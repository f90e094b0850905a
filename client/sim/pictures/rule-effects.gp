# What each effect adds to a tick; an effect that the scene does not list adds nothing.
load 'rule.gp'
csv = folder.'/effects_marginal.csv'
set title 'Only what a scene lists is computed' offset -7,0
set xlabel 'added to a tick [instructions]'
set lmargin 17; set rmargin 5
set yrange [8.6:-0.6]
set xrange [0:550]
set xtics 200
unset grid
set grid x
set boxwidth 0.6
plot csv skip 1 using (0.5*$2):1:(0.5*$2):(0.3):ytic(5) with boxxyerror fc rgb '#1f5fa8' fs solid 0.85 noborder, \
     '' skip 1 using 2:1:(sprintf('%.0f', $2)) with labels left offset 0.5,0
