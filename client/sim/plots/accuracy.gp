# What accuracy costs in time: the rate buys error of a law between its jumps, preparation and stations buy error of FEM.
# `csv`: accuracy.csv; `laws`, `stations`: the curves' names; `encoder_m`: the step whose rows are drawn; `noticed_mN`: what a
# hand notices; `sentences` of the panels.
width = 1500; height = 700
load 'style.gp'
set datafile separator ','
set datafile columnheaders
set datafile missing NaN
array shown[5] = ['VOIGT', 'VOIGT, velocity over an adaptive window', 'ENHANCED_TRACKING_WALL', 'OKAMURA', 'GOD_OBJECT']
array mark[5] = [13, 4, 7, 5, 9]
if (sentences[2] ne '') {
  stats csv using (strcol('comparator') eq 'refinement' ? 1e-3*column('prepare_ms') : NaN) nooutput
  least = STATS_min
  most = STATS_max
}
set multiplot
set tmargin at screen 1 - 130.0/height
set bmargin at screen 75.0/height
set logscale xy
set format x '%g'
set format y '%g'
set ytics (1, 2, 5, 10, 20, 50, 100, 200, 500)
set grid xtics ytics
set style textbox opaque noborder
do for [k = 1:2] {
  if (sentences[k] eq '') { continue }
  left = 0.5*(k - 1)
  set lmargin at screen left + 0.055
  set rmargin at screen left + 0.485
  unset label
  unset arrow
  set label 1 sentences[k] at screen left + 0.012, 1 - 26.0/height noenhanced font 'DejaVu Sans Bold,12' textcolor rgb title_colour
  set arrow 1 from graph 0, first noticed_mN to graph 1, first noticed_mN nohead back dt (6,4) lw 1.6 lc rgb '#c0303b'
  set label 2 sprintf('a hand notices %.1f mN', noticed_mN) at graph 0.015, first noticed_mN offset 0,0.6 font 'DejaVu Sans,12' textcolor rgb '#c0303b'
  if (k == 1) {
    set xlabel 'ticks a second [Hz]'
    set ylabel 'error between jumps, rms [mN]'
    set xtics (250, 500, 1000, 2000, 4000)
    set xrange [200:5000]
    set yrange [0.5:400]
    set key top left Left reverse noenhanced nobox font 'DejaVu Sans,12'
    name(u) = strcol('variant') eq '' ? strcol('model') : strcol('model').', '.strcol('variant')
    x(law) = strcol('comparator') eq 'verification' && name(0) eq law && abs(column('encoder_m')/encoder_m - 1) < 1e-6 ? column('rate_hz') : NaN
    plot for [i = 1:|laws|] csv using (x(laws[i])):(1e3*column('error_n')) with lines lw 1 lc rgb '#8a949c' title (i == 1 ? 'the other laws' : ''), \
      for [i = 1:5] csv using (x(shown[i])):(1e3*column('error_n')) with linespoints pt mark[i] ps 1.4 lw 2 lc rgb safe_colour[i] title shown[i]
  } else {
    set xlabel 'preparation before the lesson [s]'
    set ylabel 'error over a stroke, rms [mN]'
    set xtics (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20)
    set xrange [least/1.4:most*1.4]
    set yrange [2.5:700]
    set key bottom left Left reverse nobox noopaque font 'DejaVu Sans,12'
    plot for [i = 1:|stations|] csv using (strcol('comparator') eq 'refinement' && column('stations') == real(stations[i]) ? 1e-3*column('prepare_ms') : NaN):(1e3*column('error_n')) \
      with linespoints pt mark[i] ps 1.4 lw 2 lc rgb safe_colour[i] title stations[i]
  }
}
unset multiplot
