# Fig. 10: the tip's path and the clamping forces in space. `csv`; in mm `start`, the ends `first_way` and `changed_way` of
# the reference trajectories, `point1`, where the user gives up, `point2`, where the trajectory changes, `target`; `mm_per_n`: length of an arrow; `scene`:
# what is set by hand.
width = 1200; height = 1000
load 'style.gp'
set datafile separator ','
set arrow from start[1],start[2],start[3] to first_way[1],first_way[2],first_way[3] nohead ls 6
set arrow from start[1],start[2],start[3] to changed_way[1],changed_way[2],changed_way[3] nohead ls 6
set style line 7 pt 7 ps 1.3 lc rgb '#1c2329'
set label 'Start' at start[1],start[2],start[3] point ls 7 offset -6.5,0.6 font 'DejaVu Sans Bold,12' textcolor rgb '#1c2329' front
set label '1' at point1[1],point1[2],point1[3] point ls 7 offset -2.2,-0.4 font 'DejaVu Sans Bold,12' textcolor rgb '#1c2329' front
set label '2' at point2[1],point2[2],point2[3] point ls 7 offset 1.2,-0.6 font 'DejaVu Sans Bold,12' textcolor rgb '#1c2329' front
set label 'target' at target[1],target[2],target[3] point pt 6 ps 3.2 lw 1.6 lc rgb '#2a8a4a' offset 2,-0.4 font 'DejaVu Sans Bold,12' textcolor rgb '#2a8a4a' front
set label 100 'Virtual fixture: tool path and clamping forces' at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
set label 101 scene at screen 0.5, 0.94 center noenhanced font 'DejaVu Sans,10' textcolor rgb '#5f6a73'
set border 4095 lc rgb '#9aa4ad' lw 0.8
set view 76, 24, 1.2, 1.05
set xyplane at -42
set xrange [-16:20]
set yrange [-14:14]
set zrange [-42:22]
set xtics 10 offset 0,-0.3
set ytics 10 offset 0.5,0
set ztics 10
set xlabel 'x [mm]' offset 0,-0.8
set ylabel 'y [mm]' offset 1.5,-0.5
set zlabel 'z [mm]' rotate by 90 offset -2.5,0
set lmargin at screen 0.1
set key bmargin center horizontal maxrows 2 maxcols 3 nobox Left reverse font 'DejaVu Sans,12'
set object 1 polygon from -16,-14,0 to 20,-14,0 to 20,14,0 to -16,14,0 to -16,-14,0 fs transparent solid 0.25 border lc rgb '#d8a48f' fc rgb '#f0c9b8'
set label 'skin' at -15,-13,1.5 font 'DejaVu Sans,10' textcolor rgb '#a8664d'
# only the rows that are marked carry an arrow
splot csv using ($11 > 0 ? $2*1000 : 1/0):($3*1000):($4*1000):($5*mm_per_n):($6*mm_per_n):($7*mm_per_n) \
        skip 1 with vectors head filled size screen 0.009,16,60 ls 5 lw 1.3 title sprintf('clamping force (%g mm/N)', mm_per_n), \
      '' using ($2*1000):($3*1000):($4*1000) skip 1 with lines ls 1 title 'needle tip', \
      '' using ($2*1000):($3*1000):(-42) skip 1 with lines lc rgb '#c3cad1' lw 1.6 title 'its shadow', \
      1/0 with lines ls 6 title 'reference trajectories', \
      1/0 with points pt 6 ps 2 lw 1.6 lc rgb '#2a8a4a' title 'target'
