# Fig. 9: cutting and attracted force. `csv`, `phases`, `layer_s`: when each layer is reached, then when the way out
# begins, and `scene`: what is set by hand.
width = 1200; height = 720
load 'style.gp'
set datafile separator ','
from_s = -0.25; to_s = 1.75
load 'phases.gp'
set xrange [from_s:to_s]
set xtics 0.25
set yrange [-0.9:4.6]
set ytics 0.5
set lmargin at screen 0.075
set rmargin at screen 0.97
set tmargin at screen 0.88
set bmargin at screen 0.105
set xlabel 'time [s]'
set ylabel 'force [N]'
set label 100 'Cutting and attracted force through six layers: 1, 2, 1.5, 2.5, 3, 4 N in, 0.4 N out' at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
set label 101 scene at screen 0.5, 0.935 center noenhanced font 'DejaVu Sans,9' textcolor rgb '#5f6a73'
set arrow from from_s,-0.4 to to_s,-0.4 nohead ls 6
set arrow from from_s,0 to to_s,0 nohead ls 6
set key top right
layers = |layer_s| - 1
do for [i = 1:layers] {
  set arrow from layer_s[i],-0.9 to layer_s[i],4.6 nohead ls 6
  set label sprintf('%d', i) at (layer_s[i] + layer_s[i + 1])/2,-0.7 center font 'DejaVu Sans Bold,11' textcolor rgb '#4a5560'
}
if (layers > 0) {
  set label 'layer' at layer_s[1],-0.7 right offset -0.6,0 font 'DejaVu Sans,11' textcolor rgb '#4a5560'
}
plot csv using 1:4 skip 1 with lines lc rgb '#4a5560' lw 2 title 'no force', \
     '' using 1:($2 > 0 ? $4 : 1/0) skip 1 with lines ls 3 title 'cutting force', \
     '' using 1:($3 < 0 ? $4 : 1/0) skip 1 with lines ls 4 title 'attracted force'
