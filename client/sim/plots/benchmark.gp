# Errors on held-out force curves, a panel a question. `data`: blocks `question Q` (place, error, low and high of its
# 95 % interval in N, kind 0 trivial 1 formula 2 engine, 1: gives more than 50 µJ to the hand, 1: named, label,
# numbers); `questions`: above the panels; `floors`, `bests`, `margins`: of each, in N (below 0: none); `rows`: models;
# `finding`: lines of the title; `set`: the data's name.
panels = |questions|
width = 420 + 360*panels; height = 234 + 34*rows
load 'style.gp'
set datafile separator "\t"
set multiplot
unset key
title_text = finding[1]
do for [i = 2:|finding|] { title_text = title_text."\n".finding[i] }
set label 10 title_text at screen 0.5, 1 - 24.0/height center noenhanced font 'DejaVu Sans Bold,13' textcolor rgb title_colour
set label 11 set.": rms error on what was held out, its 95 % interval, and the model's numbers\n".\
    "hollow: trivial; orange: a law that is fitted only; blue: the engine; red: gives more than 50 µJ to the hand; square: named\n".\
    "dashed: the noise floor, all dots joined; grey: the best, and as good within the margin" \
    at screen 0.5, 46.0/height center font 'DejaVu Sans,10' textcolor rgb text_colour noenhanced
set yrange [0.3:rows + 0.7]
set xrange [0:*]
set tmargin at screen 1 - 110.0/height
set bmargin at screen 122.0/height
set xlabel 'rms error [N]' font 'DejaVu Sans,11'
set xtics font 'DejaVu Sans,10'
set grid x
left = 400.0/width
do for [q = 0:panels - 1] {
  from = left + q*(1 - left)/panels
  set lmargin at screen from + 0.008
  set rmargin at screen from + (1 - left)/panels - 0.012
  set title questions[q + 1] font 'DejaVu Sans Bold,12' offset 0,-0.6
  block = sprintf('question %d;', q)
  if (q == 0) { set ytics noenhanced font 'DejaVu Sans,9' } else { unset ytics }
  # the labels of the rows, once
  labels = q == 0 ? "data index block using (0):1:ytic(8) with points pt 7 ps 0 notitle, " : ''
  unset arrow
  unset object
  if (floors[q + 1] >= 0) { set arrow 1 from first floors[q + 1], graph 0 to first floors[q + 1], graph 1 nohead dt 2 lw 1.4 lc rgb '#5b6670' }
  if (bests[q + 1] >= 0) { set object 1 rectangle from first bests[q + 1], graph 0 to first bests[q + 1] + margins[q + 1], graph 1 behind fc rgb '#e6ebef' fs solid noborder }
  of(kind, gives, named) = sprintf('(column(5) == %d && column(6) == %d && column(7) == %d ? column(2) : NaN)', kind, gives, named)
  errors(kind, gives, named, mark, colour) = sprintf("data index block using %s:1:3:4 with xerrorbars pt %d ps 1.3 lw 1.6 lc rgb '%s' notitle", \
    of(kind, gives, named), mark, colour)
  numbers = ", data index block using 4:1:9 with labels left offset 0.8,0 font 'DejaVu Sans,9' textcolor rgb '#7d8790' notitle"
  eval 'plot '.labels.errors(0, 0, 0, 6, '#5b6670').', '.errors(1, 0, 0, 7, safe_colour[5]).', '.errors(1, 0, 1, 5, safe_colour[5]).', ' \
    .errors(2, 0, 0, 7, safe_colour[1]).', '.errors(2, 0, 1, 5, safe_colour[1]).', '.errors(2, 1, 0, 7, '#c0303b').', '.errors(2, 1, 1, 5, '#c0303b').numbers
  unset label
}
unset multiplot
