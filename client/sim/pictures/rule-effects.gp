# What each effect adds to a tick in the six layers; an effect that the scene does not list adds nothing.
load 'rule.gp'
csv = folder.'/effects_marginal.csv'
set title 'Only what a scene lists is computed' offset -7,0
set xlabel 'added to a tick [instructions]'
set lmargin 17; set rmargin 5
set yrange [9.6:-0.6]
set xrange [0:1100]
set xtics 400
unset grid
set grid x
set boxwidth 0.6
set datafile columnheaders
set datafile missing NaN
x(u) = strcol('scene') eq 'six layers' ? column('mean_instructions') : NaN
plot csv using (0.5*x(0)):'place':(0.5*x(0)):(0.3):ytic(strcol('effect')) with boxxyerror fc rgb '#1f5fa8' fs solid 0.85 noborder, \
     '' using (x(0)):'place':(sprintf('%.0f', x(0))) with labels left offset 0.5,0
