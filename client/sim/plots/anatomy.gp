# A section of a patient's field, and what the layers along a path cost. `rows`: anatomy.csv; `section`: section.csv, -1 outside;
# `names`, `tissues` of the structures; `patient`, `cut`, `across`, `up`: words.
set datafile separator ','
width = 1400; height = 620
load 'style.gp'
# by pb::Layer::Tissue: none, skin, fat, muscle, bursa, capsule, tendon, cartilage, bone, other
array tissue_colour[10] = ['#9aa4ac', '#e7b79c', '#f2d98d', '#b4545a', '#79a9d8', '#8fb79a', '#efe6d6', '#bcd9ea', '#f6f3ec', '#c9a0d0']
array name_colour[64]
count = |names|
do for [i = 1:count] { name_colour[i] = tissue_colour[int(tissues[i]) + 1] }
# nerves and vessels have no tissue of their own
do for [i = 1:count] {
  if (strstrt(names[i], 'nerve') > 0) { name_colour[i] = '#f0c419' }
  if (strstrt(names[i], 'artery') > 0 || strstrt(names[i], 'vein') > 0) { name_colour[i] = '#c0303b' }
}
palette_text = '-1 "#ffffff"'
do for [i = 1:count] { palette_text = palette_text.sprintf(', %d "%s"', i - 1, name_colour[i]) }
eval 'set palette defined ('.palette_text.')'
set palette maxcolors count + 1
set cbrange [-1:count - 1]
unset colorbox
stats rows using ($1 == 1 ? $2 : NaN) skip 1 nooutput
sphere_title = sprintf('sphere steps, at least %g to %g mm', STATS_min, STATS_max)
set multiplot
# the section: square pixels
set lmargin at screen 0.065
set rmargin at screen 0.40
set bmargin at screen 0.11
set tmargin at screen 0.90
set size ratio -1
set title patient.', '.cut font title_font textcolor rgb title_colour
set xlabel across.', mm'
set ylabel up.', mm'
set key at screen 0.41, 0.88 left top vertical Left reverse nobox font 'DejaVu Sans,10'
set autoscale fix
unset grid
plot section using 1:2:3 skip 1 with image notitle, for [i = 1:count] keyentry with points pt 5 ps 1.6 lc rgb name_colour[i] title names[i]
# error against time
set size noratio
set lmargin at screen 0.70
set rmargin at screen 0.98
set title 'A stack of layers: error against time' font title_font textcolor rgb title_colour
set xlabel 'processor time of a march, median, µs'
set ylabel 'force off the reference, rms, N' offset -1
set logscale xy
set autoscale
floor_N = 1e-5
set yrange [floor_N/2:0.2]
set xrange [5:1000]
set format y '%g'
set grid
set key at graph 0.98, 0.98 right top vertical Right noreverse box
set arrow 1 from graph 0, first 0.02 to graph 1, first 0.02 nohead ls 6
set label 1 'goal: 0.02 N' at graph 0.02, first 0.026 font 'DejaVu Sans,10' textcolor rgb text_colour
plot rows using ($1 == 0 ? $5 : NaN):($4 > floor_N ? $4 : floor_N) skip 1 with linespoints ls 2 pt 7 title 'fixed steps', \
     rows using ($1 == 1 ? $5 : NaN):($4 > floor_N ? $4 : floor_N) skip 1 with linespoints ls 1 pt 7 title sphere_title, \
     rows using ($1 == 0 ? $5 : NaN):($4 > floor_N ? $4 : floor_N):(sprintf('%g mm', $2)) skip 1 with labels rotate by 45 left offset 0.4,0.5 font 'DejaVu Sans,9' notitle
unset multiplot
