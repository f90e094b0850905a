# Errors on held-out force curves, a panel a question. `data`: blocks `question Q` (place, error, low and high of its
# 95 % interval in N, kind 0 baseline 1 formula 2 engine, 1: gives more than 50 µJ to the hand, 1: shown to predict,
# label); `questions`: above the panels; `rows`: models; `finding`: lines of the title; `set`: the data's name.
panels = |questions|
width = 420 + 360*panels; height = 190 + 34*rows
load 'style.gp'
set datafile separator "\t"
set multiplot
unset key
title_text = finding[1]
do for [i = 2:|finding|] { title_text = title_text."\n".finding[i] }
set label 10 title_text at screen 0.5, 1 - 24.0/height center noenhanced font 'DejaVu Sans Bold,13' textcolor rgb title_colour
set label 11 set.': rms error on what was held out, with its 95 % interval. Hollow: no model; orange: law that is fitted only; blue: engine; red: gives more than 50 µJ to the hand; square: shown to predict' \
    at screen 0.5, 16.0/height center font 'DejaVu Sans,10' textcolor rgb text_colour noenhanced
set yrange [0.3:rows + 0.7]
set xrange [0:*]
set tmargin at screen 1 - 110.0/height
set bmargin at screen 78.0/height
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
  set ytics noenhanced font 'DejaVu Sans,9'
  plot data index block using (0):1:ytic(q == 0 ? strcol(8) : '') with points pt 7 ps 0 notitle, \
       '' index block using (column(5) == 0 ? column(2) : NaN):1:3:4 with xerrorbars pt 6 ps 1.3 lw 1.6 lc rgb '#5b6670' notitle, \
       '' index block using (column(5) == 1 && column(7) == 0 ? column(2) : NaN):1:3:4 with xerrorbars pt 7 ps 1.3 lw 1.6 lc rgb safe_colour[5] notitle, \
       '' index block using (column(5) == 1 && column(7) == 1 ? column(2) : NaN):1:3:4 with xerrorbars pt 5 ps 1.4 lw 1.6 lc rgb safe_colour[5] notitle, \
       '' index block using (column(5) == 2 && column(6) == 0 && column(7) == 0 ? column(2) : NaN):1:3:4 with xerrorbars pt 7 ps 1.3 lw 1.6 lc rgb safe_colour[1] notitle, \
       '' index block using (column(5) == 2 && column(6) == 0 && column(7) == 1 ? column(2) : NaN):1:3:4 with xerrorbars pt 5 ps 1.4 lw 1.6 lc rgb safe_colour[1] notitle, \
       '' index block using (column(5) == 2 && column(6) == 1 ? column(2) : NaN):1:3:4 with xerrorbars pt 7 ps 1.3 lw 1.6 lc rgb '#c0303b' notitle
  unset label
}
unset multiplot
