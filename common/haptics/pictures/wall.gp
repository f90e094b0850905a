# usage: gnuplot -e "out='wall.png'" wall.gp  (in the folder of wall.csv and wall-out.csv; see draw)
set terminal pngcairo size 1200,980 font 'DejaVu Sans,11'
set output out
load system("dirname ".ARG0)."/style.gp"
set datafile separator ','
set multiplot

# three schemes: tip x, wall w, spring between; depth grows to the right
set size 0.333,0.3
unset grid; unset border; unset tics
set xrange [-2:22]; set yrange [-3:7]
do for [i=0:2] {
  set origin 0.333*i,0.7
  title = i == 0 ? 'In: the wall is dragged behind' : i == 1 ? 'Stop: the wall creeps up' : 'Out: the wall is dragged ahead'
  x = i == 0 ? 14 : i == 1 ? 14 : 9
  w = i == 0 ? 10 : i == 1 ? 13.4 : 10.6
  words = i == 0 ? 'x − w = Δ_{cut}:  f = −f_{cut}' : i == 1 ? 'x − w shrinks to f_{rej}/K_t' : 'w − x = Δ_{att}:  f = +f_{att}'
  move = i == 0 ? '→' : i == 1 ? '·' : '←'
  set title title font 'DejaVu Sans,13'
  set object 1 rect from 0,-2 to 22,4.6 fc rgb '#f6e3d5' behind
  set label 1 'skin' at -0.2,5.2 center tc rgb quiet
  set object 2 rect from -2,0.9 to x-1,1.1 fc rgb needle front
  set arrow 1 from x-1,1 to x,1 lw 3 lc rgb needle head filled size 0.6,20 front
  set label 2 'tip x  '.move at x,2.1 center tc rgb needle front
  set arrow 2 from w,-1.6 to w,0.6 nohead lw 6 lc rgb wall front
  set label 3 'wall w' at w,-2.5 center tc rgb wall front
  set arrow 3 from w,-0.4 to x,-0.4 heads size 0.3,25 lw 1.5 lc rgb quiet front
  set label 4 words at 10.5,5.4 center font 'DejaVu Sans,11'
  plot NaN notitle
}
unset object; unset arrow; unset label; unset title

# the same from the engine
set border 3 lc rgb '#606a75'
set xtics nomirror
set ytics nomirror
set grid lc rgb '#d8dde3'
set size 1,0.38
set origin 0,0.33
set lmargin 10; set rmargin 4
set xrange [0:6.2]
set yrange [22:-5]
set key at 2.4,4 left samplen 2 noautotitle
set ylabel 'along the trajectory [mm]'
set xlabel ''
set label 1 'in' at 0.9,-3.4 center tc rgb quiet
set label 2 'stop' at 2.8,-3.4 center tc rgb quiet
set label 3 'out' at 4.8,-3.4 center tc rgb quiet
set arrow 1 from 1.6,-5 to 1.6,22 nohead dt 3 lc rgb quiet
set arrow 2 from 4.0,-5 to 4.0,22 nohead dt 3 lc rgb quiet
plot 'wall.csv' skip 1 using 1:(-$4*1e3) with lines lw 2.5 lc rgb needle title 'tip x', \
     'wall-out.csv' skip 1 using 1:(-$10*1e3) with lines lw 2.5 lc rgb wall title 'wall w'
unset label; unset arrow
set size 1,0.33
set origin 0,0
set yrange [-2.4:1.2]
set ylabel 'force on the hand, along u [N]'
set xlabel 'time [s]'
set arrow 1 from 1.6,-2.4 to 1.6,1.2 nohead dt 3 lc rgb quiet
set arrow 2 from 4.0,-2.4 to 4.0,1.2 nohead dt 3 lc rgb quiet
set label 1 '−f_{cut}' at 1.0,-2.15 center
set label 2 '−f_{rej}' at 3.3,-0.55 center
set label 3 '+f_{att}' at 5.0,1.0 center
plot 'wall-out.csv' skip 1 using 1:($17+$18) with lines lw 2.5 lc rgb '#2e4057'
unset multiplot
