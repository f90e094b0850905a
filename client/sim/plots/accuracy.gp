# Error against cost, both logarithmic, a panel a comparison. `width`, `height`, `title`; `data` has blocks, in pixels from
# the lower left unless said:
#   panels      number; frame left, bottom, right, top; axes' ranges in their units; level; titles of x and y; level's name
#   xtics P, ytics P, filled P, hollow P, bars P, xbars P, front P S    of panel P, series S, in the axes' units
#   titles, captions, legend, names, leads, text               over the whole picture
load 'style.gp'
set datafile separator "\t"
# Okabe and Ito's colours, told apart by colour-blind people too; the shape says it again
array series_colour[6] = [0x0072B2, 0xD55E00, 0x009E73, 0xCC79A7, 0x7A5C00, 0x56B4E9]
array filled_point[6] = [7, 5, 9, 13, 11, 15]
array hollow_point[6] = [6, 4, 8, 12, 10, 14]
series(n) = int(n) % 6 + 1
stats data index 'panels;' using 1 nooutput
panels = STATS_records
set multiplot
unset key

# below everything: lines from far names to their points, the title, and how to read the points
unset border
unset tics
set lmargin at screen 0
set rmargin at screen 1
set bmargin at screen 0
set tmargin at screen 1
set xrange [0:width]
set yrange [0:height]
set label 1 title at width/2.0,height - 24 center noenhanced font 'DejaVu Sans Bold,17' textcolor rgb title_colour
set label 2 ' fits its rate' at 60,18 left font 'DejaVu Sans,11' textcolor rgb text_colour point pt 7 ps 1.3 lc rgb '#4a5560' offset 0.8,0
set label 3 ' too slow for its rate' at 205,18 left font 'DejaVu Sans,11' textcolor rgb text_colour point pt 6 ps 1.3 lw 2 lc rgb '#4a5560' offset 0.8,0
set label 4 '– – –  Pareto front: nothing is both cheaper and more accurate' at 405,18 left font 'DejaVu Sans,11' textcolor rgb text_colour
set label 5 'bars: error, sd over repeats; time, five runs' at 880,18 left font 'DejaVu Sans,11' textcolor rgb text_colour
plot -1, data index 'leads;' using 1:2:3:4 with vectors nohead lc rgb '#9aa4ad' lw 0.8
unset label

set border 3
set tics nomirror out scale 0.6 textcolor rgb text_colour
do for [i = 0:panels - 1] {
  # stats counts what is within the axes only
  unset logscale
  set autoscale
  stats data index 'panels;' every ::i::i using (number = $1, left = $2, bottom = $3, right = $4, top = $5, x_from = $6, x_to = $7, \
      y_from = $8, y_to = $9, level = $10, x_title = strcol(11), y_title = strcol(12), level_name = strcol(13), 0) nooutput
  set lmargin at screen left/width
  set rmargin at screen right/width
  set bmargin at screen bottom/height
  set tmargin at screen top/height
  tics = ''
  stats data index sprintf('xtics %d;', number) using (tics = tics.sprintf("'%s' %.6g, ", strcol(2), $1), 0) nooutput
  eval sprintf('set xtics nomirror (%s)', tics[1:strlen(tics) - 2])
  tics = ''
  stats data index sprintf('ytics %d;', number) using (tics = tics.sprintf("'%s' %.6g, ", strcol(2), $1), 0) nooutput
  eval sprintf('set ytics nomirror (%s)', tics[1:strlen(tics) - 2])
  set logscale xy
  set xrange [x_from:x_to]
  set yrange [y_from:y_to]
  set xlabel x_title noenhanced
  set ylabel y_title noenhanced offset 0.8,0  # within the picture, also left of 0.001 N
  if (level > 0) {
    set arrow 1 from graph 0, first level to graph 1, first level nohead ls 6 back
    set label 1 level_name at graph 0.995, first level right offset 0,0.5 noenhanced font 'DejaVu Sans,9' textcolor rgb '#5f6a73'
  } else {
    unset arrow
    unset label
  }
  plot for [s = 0:5] data index sprintf('front %d %d;', number, s) using 1:2 with steps lc rgb series_colour[s + 1] lw 1.6 dt (8,5), \
       data index sprintf('bars %d;', number) using 1:2:3:4:(series_colour[series($5)]) with yerrorbars lc rgb variable lw 1 pt 0, \
       '' index sprintf('xbars %d;', number) using 1:2:3:4:(series_colour[series($5)]) with xerrorbars lc rgb variable lw 1 pt 0, \
       '' index sprintf('filled %d;', number) using 1:2:(filled_point[series($3)]):(series_colour[series($3)]) with points pt variable lc rgb variable ps 1.5, \
       '' index sprintf('hollow %d;', number) using 1:2:(hollow_point[series($3)]):(series_colour[series($3)]) with points pt variable lc rgb variable ps 1.5 lw 2
}

# above everything: texts
unset label
unset arrow
unset logscale
unset border
unset tics
unset xlabel
unset ylabel
set lmargin at screen 0
set rmargin at screen 1
set bmargin at screen 0
set tmargin at screen 1
set xrange [0:width]
set yrange [0:height]
plot -1, \
     data index 'titles;' using 1:2:3 with labels left noenhanced font 'DejaVu Sans Bold,13' textcolor rgb title_colour, \
     '' index 'captions;' using 1:2:3 with labels left noenhanced font 'DejaVu Sans,10' textcolor rgb '#4a5560', \
     '' index 'legend;' using 1:2:(filled_point[series($3)]):(series_colour[series($3)]) with points pt variable lc rgb variable ps 1.1, \
     '' index 'legend;' using 1:2:4 with labels left offset 0.6,0 noenhanced font 'DejaVu Sans,10', \
     '' index 'names;' using 1:2:4:(series_colour[series($3)]) with labels center noenhanced font 'DejaVu Sans,10' textcolor rgb variable, \
     '' index 'text;' using 1:2:3 with labels left noenhanced font 'DejaVu Sans,12' textcolor rgb title_colour
unset multiplot
