# Each needle's puncture force predicted from the two others; left from recorded traces, right from stated means.
# `data`: blocks `measured P`, `predicted P` (diameter in mm, force, sd in N) of panel P = 0 and 1; an entry for each of the
# panels' needles in `scale`, `exponent` (law of the two others), `diameter_mm`, `needle`, `legend`; `finding`: the title.
width = 1300; height = 850
load 'style.gp'
set datafile separator "\t"
set multiplot
set label 1 finding at screen 0.5, 0.965 center font title_font textcolor rgb title_colour
set tmargin at screen 0.84
set bmargin at screen 0.10
set logscale xy
set xrange [0.7:1.95]
set yrange [0.1:0.9]
set xtics (0.8,1,1.25,1.6)
set ytics (0.1,0.15,0.2,0.3,0.4,0.5,0.7)
set xlabel 'outer diameter [mm]'
set key top left Left reverse
array law_colour[3] = [1, 3, 4]
do for [panel = 0:1] {
  set lmargin at screen (panel == 0 ? 0.085 : 0.56)
  set rmargin at screen (panel == 0 ? 0.51 : 0.985)
  set ylabel (panel == 0 ? 'puncture force [N]' : '')
  set label 2 (panel == 0 ? 'peaks of the five recorded traces' : 'means and sd as the source states them') \
      at graph 0.5, 1.03 center font 'DejaVu Sans,12' textcolor rgb text_colour
  do for [i = 1:3] {
    set label 20 + i needle[3*panel + i] at diameter_mm[3*panel + i], graph 0.03 center font 'DejaVu Sans,12'
  }
  plot data index sprintf('measured %d;', panel) using 1:2:3 with yerrorbars pt 7 ps 1.3 lw 2 lc rgb safe_colour[7] title 'measured, ±1 sd', \
       '' index sprintf('predicted %d;', panel) using 1:2:3 with yerrorbars pt 4 ps 1.4 lw 2 lc rgb safe_colour[2] \
           title 'predicted from the two others, ±1 sd', \
       for [i = 1:3] scale[3*panel + i]*x**exponent[3*panel + i] with lines lw 1.8 dt (6,4) lc rgb safe_colour[law_colour[i]] title legend[3*panel + i]
  unset label
}
unset multiplot
