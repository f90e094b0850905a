# Cases × models, the most troubled first, each cell with its verdict and what was measured. `data`: blocks `models` (column, 1 for the
# enhanced wall, name), `cases` (row, name, limit), `cells` (column, row, look, text); `finding`: the title.
set datafile separator "\t"
stats data index 'models;' using 1 nooutput
models = STATS_records
stats data index 'cases;' using 1 nooutput
cases = STATS_records
# the longest line under a name decides the width of the names: a letter of 9 pt is some 6 px wide
stats data index 'cases;' using (strlen(strcol(3))) nooutput
names_px = STATS_max*6.1 + 20 > 420 ? STATS_max*6.1 + 20 : 420
width = names_px + 80 + 96*models; height = 130 + 40*cases
load 'style.gp'
unset border
unset tics
unset grid
unset key
# one unit a cell over the whole picture; names stand to the left of x = 0 and above y = 0
cell_px = (width - names_px - 20.0)/models
set lmargin at screen 0
set rmargin at screen 1
set bmargin at screen 0
set tmargin at screen 1
set xrange [-names_px/cell_px:models + 20/cell_px]
set yrange [cases + 52/40.0:-78/40.0]
# looks: says nothing, stable, chatters, diverges, stable like all: blue, orange, dark are told apart without colour sight, and in print
array fill[5] = [0xffffff, 0xcfe2f3, 0xf6b26b, 0x5b1a4b, 0xeceeef]
array ink[5] = [0x9aa3ab, 0x16324f, 0x3b2405, 0xffffff, 0x9aa3ab]
set label 1 finding at screen 0.5, 1 - 24.0/height center noenhanced font 'DejaVu Sans Bold,11' textcolor rgb title_colour
# the key below: three verdicts, and cases in which all are equal
array key_text[4] = ['over the limit (*: its other condition), bounded', 'grows, or only the gate holds it', 'stable', 'stable, and equal for all']
array key_look[4] = [2, 3, 1, 4]
array key_at[4] = [-1.2, 2.7, 5.6, 6.6]
stretch = models > 9 ? models/9.0 : 1.0
do for [i = 1:4] {
  left = key_at[i]*stretch
  set object i rectangle from left, cases + 0.35 to left + 0.22, cases + 0.75 fillcolor rgb fill[key_look[i] + 1] fillstyle solid 1 border lc rgb '#ffffff'
  set label i + 1 key_text[i] at left + 0.3, cases + 0.55 left font 'DejaVu Sans,10' textcolor rgb '#4a5560'
}
plot data index 'cells;' using ($1 + 0.5):($2 + 0.5):(0.5):(0.5):(fill[int($3) + 1]) with boxxyerror lc rgb variable fillstyle solid 1 border lc rgb '#ffffff', \
     '' index 'cells;' using ($1 + 0.5):($2 + 0.5):4:(ink[int($3) + 1]) with labels noenhanced font 'DejaVu Sans,10' textcolor rgb variable, \
     '' index 'cases;' using (-0.12):($1 + 0.3):2 with labels right noenhanced font 'DejaVu Sans,11' textcolor rgb title_colour, \
     '' index 'cases;' using (-0.12):($1 + 0.72):3 with labels right noenhanced font 'DejaVu Sans,9' textcolor rgb '#7d8790', \
     '' index 'models;' using ($2 == 1 ? $1 + 0.5 : NaN):(-0.4):3 with labels font 'DejaVu Sans Bold,11' textcolor rgb title_colour, \
     '' index 'models;' using ($2 == 0 ? $1 + 0.5 : NaN):(-0.4):3 with labels font 'DejaVu Sans,11' textcolor rgb title_colour
