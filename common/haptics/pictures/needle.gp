# usage: gnuplot -e "out='needle.png'" needle.gp  (in the folder of needle-out.csv; see draw)
set terminal pngcairo size 1200,620 font 'DejaVu Sans,11'
set output out
load system("dirname ".ARG0)."/style.gp"
set datafile separator ','
set lmargin 10; set rmargin 30
set title 'What acts along the trajectory, in and out through four layers' font 'DejaVu Sans,14'
set xlabel 'depth of the tip [mm]'
set ylabel 'force on the hand, along u [N]'
set xrange [0:30]
set yrange [-3.6:1.6]
set key at screen 0.985,0.86 right samplen 2
set object 1 rect from 0,-3.6 to 4,1.6 fc rgb '#f6e3d5' behind
set object 2 rect from 4,-3.6 to 12,1.6 fc rgb '#fbf3d9' behind
set object 3 rect from 12,-3.6 to 22,1.6 fc rgb '#f3d9d9' behind
set object 4 rect from 22,-3.6 to 30,1.6 fc rgb '#dceaf2' behind
set label 1 'skin' at 2,1.4 center
set label 2 'fat' at 8,1.4 center
set label 3 'muscle' at 17,1.4 center
set label 4 'bursa' at 26,1.4 center
in(t, v) = t < 3.2 ? v : NaN
out_(t, v) = t > 3.6 ? v : NaN
plot 'needle-out.csv' skip 1 using ($13*1e3):(in($1,$17)) with lines lw 2 lc rgb wall title 'cutting, in', \
     '' skip 1 using ($13*1e3):(in($1,$20)) with lines lw 2 lc rgb '#7b3fa0' title 'puncture, in', \
     '' skip 1 using ($13*1e3):(in($1,$19)) with lines lw 2 lc rgb '#e09f3e' title 'friction, in', \
     '' skip 1 using ($13*1e3):(in($1,$17+$18+$19+$20)) with lines lw 3 lc rgb '#2e4057' title 'sum, in', \
     '' skip 1 using ($13*1e3):(out_($1,$18)) with lines lw 2 dt 2 lc rgb needle title 'attracted, out', \
     '' skip 1 using ($13*1e3):(out_($1,$19)) with lines lw 2 dt 2 lc rgb '#e09f3e' title 'friction, out', \
     '' skip 1 using ($13*1e3):(out_($1,$17+$18+$19+$20)) with lines lw 3 dt 2 lc rgb '#2e4057' title 'sum, out'
