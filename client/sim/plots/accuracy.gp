# Four comparators, and what a tick costs: six panels, each with its title, what it shows and its sentence.
# `titles`, `shows`, `sentences` of the panels; `data` has blocks, P the panel, S the series:
#   names P;    place, name                        dots P S;   x, place, low, high, label
#   lines P S;  x of a baseline, from place, to place
#   curve P S;  x, y, low and high of y, label    (S: the place in `stations`)
# `stations`: the names of the curves; `x_from`, `x_to`, `y_from`, `y_to` of the panels' data, 0 for a panel without.
width = 1640; height = 1780
load 'style.gp'
set datafile separator "\t"
array mark[6] = [7, 9, 11, 4, 6, 5]
array colour[6] = ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#7A5C00', '#20262c']
array series[6]
series[1] = "1 kHz, 10 µm|250 Hz|4 kHz|50 µm|1 µm"
series[2] = "1 kHz, 10 µm"
series[3] = "every second 0.5 mm|beyond half of it|hold|withdrawal"
series[5] = "median, and up to p99.9"
array axis[6] = ['rms error [mN]', 'rms error [mN]', 'rms error on what was held out [mN]; dashed: the better baseline', 'nodes of the mesh', "a tick in the station's loop [µs]", 'instructions of a tick, which repeat exactly']
set multiplot
part(text, n) = n > 1 ? part(text[strstrt(text, '|') + 1:*], n - 1) : strstrt(text, '|') > 0 ? text[1:strstrt(text, '|') - 1] : text
parts(text) = strstrt(text, '|') > 0 ? 1 + parts(text[strstrt(text, '|') + 1:*]) : 1
do for [k = 1:6] {
  left = k % 2 == 1 ? 0.0 : 0.5
  top = 1 - ((k - 1)/2)/3.0
  curve = k == 4 || k == 6
  set lmargin at screen left + (curve ? 0.05 : 0.17)
  set rmargin at screen left + 0.485
  set tmargin at screen top - 132.0/height
  set bmargin at screen top - 1/3.0 + 82.0/height
  if (x_to[k] <= 0) { continue }
  unset label
  unset logscale
  set label 1 titles[k] at screen left + 0.012, top - 18.0/height noenhanced font 'DejaVu Sans Bold,13' textcolor rgb title_colour
  set label 2 sentences[k] at screen left + 0.012, top - 42.0/height noenhanced font 'DejaVu Sans,11' textcolor rgb '#1f5fa8'
  set label 3 shows[k] at screen left + 0.012, top - 100.0/height noenhanced font 'DejaVu Sans,9' textcolor rgb '#5f6a73'
  set xlabel axis[k] font 'DejaVu Sans,11' offset 0,0.4
  unset ylabel
  set ytics auto
  set autoscale
  set grid x
  unset key
  # below the axis what the marks mean
  count = curve ? |stations| : parts(series[k])
  do for [s = 1:count] {
    name = curve ? stations[s] : part(series[k], s)
    place = 10 + s
    set label place name at screen left + 0.05 + (s - 1)*0.43/(count > 3 ? count : 3), \
        top - 1/3.0 + 10.0/height left offset 1.2,0 noenhanced font 'DejaVu Sans,10' textcolor rgb text_colour point pt mark[s] ps 1.2 lc rgb colour[s]
  }
  set xtics auto font 'DejaVu Sans,10'
  set logscale x
  set format x '%g'
  if (curve) {
    set ylabel 'rms error [mN]' font 'DejaVu Sans,11'
    set logscale y
    set ytics (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000) font 'DejaVu Sans,10'
    set yrange [y_from[k]/1.3:y_to[k]*1.3]
    of = sprintf("for [s = 1:|stations|] data index sprintf('curve %d %%d;', s) using 1:2", k - 1)
    points = of." with linespoints pt mark[s] ps 1.4 lw 1.8 lc rgb colour[s] notitle"
    if (k == 4) {
      set xrange [x_from[k]/1.3:x_to[k]*1.3]
      set xtics (500, 1000, 2000, 5000, 10000, 20000, 50000, 100000)
      eval 'plot '.of.":3:4 with yerrorbars pt 7 ps 0 lw 1 lc rgb colour[s] notitle, ".points
    } else {
      unset logscale x
      set xrange [0.75*x_from[k]:x_to[k]*1.15]
      set xtics auto
      eval 'plot '.points.', '.of.":5 with labels left offset 0.9,0 font 'DejaVu Sans,9' textcolor rgb '#5f6a73' notitle"
    }
  } else {
    stats data index sprintf('names %d;', k - 1) using 1 nooutput
    unset logscale y
    set xrange [x_from[k]/1.5:x_to[k]*(k == 3 ? 1.5 : 2.2)]
    set yrange [STATS_max + 0.7:STATS_min - 0.7]
    set ytics noenhanced font 'DejaVu Sans,9'
    n = parts(series[k])
    shift(s) = n > 2 && k == 1 ? 0.14*(s - 0.5*(n + 1)) : k == 3 && s <= 2 ? 0.24*(s - 1.5) : 0
    plot data index sprintf('names %d;', k - 1) using (NaN):1:ytic(2) with points notitle, \
      for [s = 1:n] data index sprintf('lines %d %d;', k - 1, s) using 1:2:(0):($3 - $2) with vectors nohead dt (4,3) lw 1.6 lc rgb colour[s] notitle, \
      for [s = 1:n] data index sprintf('dots %d %d;', k - 1, s) using 1:($2 + shift(s)):3:4 with xerrorbars pt 7 ps 0 lw 1.1 lc rgb colour[s] notitle, \
      for [s = 1:n] data index sprintf('dots %d %d;', k - 1, s) using 1:($2 + shift(s)) with points pt mark[s] ps 1.1 lc rgb colour[s] notitle, \
      for [s = 1:n] data index sprintf('dots %d %d;', k - 1, s) using (x_to[k]*1.15):2:5 with labels left font 'DejaVu Sans,8' textcolor rgb '#5f6a73' notitle
  }
}
unset multiplot
