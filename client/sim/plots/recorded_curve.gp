# Three models fitted to a recorded force-depth curve, a panel a way of holding out. `data`: blocks `fitted P`,
# `heldout P` and `model P M` (depth in mm, force in N) of panel P = 0 (every second block of `block_mm` held out) and
# 1 (all beyond `split_mm`), model M = 0 to 2; `finding`: the title; `legend`: of panel 0's models, then of panel 1's;
# `baselines`: the baseline's error, a text a panel.
width = 1500; height = 1050
load 'style.gp'
set datafile separator "\t"
to_mm = 48
set multiplot
set label 1 finding at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
set lmargin at screen 0.065
set rmargin at screen 0.985
set xrange [0:to_mm]
set yrange [-0.15:2.7]
set ytics 0.5
set key at graph 0.01, 0.90 left top Left reverse samplen 2 spacing 1.15 font 'DejaVu Sans,11'
set ylabel 'force on the needle [N]'
do for [panel = 0:1] {
  unset object
  if (panel == 0) {
    do for [i = 1:int(to_mm/block_mm/2 + 0.5)] {
      set object i rectangle from first (2*i - 1)*block_mm, graph 0 to first 2*i*block_mm, graph 1 behind fc rgb shade_colour fs solid noborder
    }
  } else {
    set object 1 rectangle from first split_mm, graph 0 to first to_mm, graph 1 behind fc rgb shade_colour fs solid noborder
  }
  set tmargin at screen (panel == 0 ? 0.925 : 0.475)
  set bmargin at screen (panel == 0 ? 0.53 : 0.07)
  set label 2 (panel == 0 ? 'held out: every second 0.5 mm (shaded); rms error there' : \
                            'fitted on the first 25 mm, held out: the rest (shaded); rms error there') \
      at graph 0.01, 0.955 font 'DejaVu Sans,12' textcolor rgb text_colour front
  set label 3 baselines[panel + 1] at graph 0.99, 0.955 right font 'DejaVu Sans,12' textcolor rgb text_colour front
  set xlabel (panel == 0 ? '' : 'depth [mm]')
  set format x (panel == 0 ? '' : '%g')
  plot data index sprintf('fitted %d;', panel) using 1:2 with points pt 7 ps 0.5 lc rgb '#5b6670' title 'recorded, fitted on', \
       '' index sprintf('heldout %d;', panel) using 1:2 with points pt 6 ps 0.6 lc rgb '#20262c' title 'recorded, held out', \
       for [m = 0:1] '' index sprintf('model %d %d;', panel, m) using 1:2 with lines lw 2.2 lc rgb safe_colour[m + 1] title legend[3*panel + m + 1], \
       '' index sprintf('model %d 2;', panel) using 1:2 with lines lw 2.2 dt (9,4) lc rgb safe_colour[3] title legend[3*panel + 3]
  unset label 1
}
unset multiplot
