# The largest stiffness at which the wall comes to a full rest, over dry friction and encoder step. `csv`:
# stiffness_rest.csv; `bound`: 2b/T in N/m.
width = 1150; height = 800
load 'style.gp'
load 'models.gp'
set datafile separator ','
steps = ''    # of the encoder, in µm
stats csv using (strstrt(steps.' ', sprintf(' %g ', $1*1e6)) > 0 ? 0 : (steps = steps.sprintf(' %g', $1*1e6), 0)) skip 1 nooutput
stats csv using ($4 == 0 && $5 > 0 ? $3/$5 : NaN) skip 1 nooutput    # measured over theory
array mark[3] = [1, 3, 6]
set logscale xy
set xrange [0.002:0.45]
set yrange [40:16000]
set samples 2000
set lmargin at screen 0.115
set rmargin at screen 0.97
set bmargin at screen 0.1
set tmargin at screen 0.9
set label 100 'A coarse encoder needs dry friction, or the wall never comes to rest' at screen 0.5, 0.975 center font 'DejaVu Sans Bold,17' textcolor rgb title_colour
set label 101 sprintf('1 kHz, no delay; theory K ≤ min(2b/T, 2f_c/Δ) is on the safe side: measured %.1f to %.1f times as much', STATS_min, STATS_max) at screen 0.5, 0.945 center font 'DejaVu Sans,12' textcolor rgb '#4a5560'
set xlabel 'dry friction of the device f_c [N]'
set ylabel 'largest K at which the needle stands still after a nudge [N/m]'
set xtics (0.003, 0.01, 0.03, 0.1, 0.3)
set ytics ('50' 50, '100' 100, '200' 200, '500' 500, '1000' 1000, '2000' 2000, '5000' 5000, '10,000' 10000)
set key bottom right Left reverse
set arrow 1 from graph 0, first 10000 to graph 1, first 10000 nohead ls 6
set label 2 'largest K of a profile: stands still there too' at graph 0.02, first 11600 left font 'DejaVu Sans,10' textcolor rgb '#7d8790'
least(a, b) = a < b ? a : b
step_um(i) = word(steps, i) + 0.0
colour(i) = model_colour[mark[(i - 1) % 3 + 1]]
point(i) = model_point[mark[(i - 1) % 3 + 1]]
plot for [i = 1:words(steps)] least(bound, 2*x/(step_um(i)*1e-6)) with lines lw 2 lc rgb colour(i) \
         title sprintf('theory, encoder step Δ = %.0f µm', step_um(i)), \
     for [i = 1:words(steps)] csv using (abs($1*1e6/step_um(i) - 1) < 1e-3 ? $2 : NaN):3 skip 1 \
         with points ps 1.7 lw 2 pt point(i) lc rgb colour(i) title sprintf('measured, %.0f µm', step_um(i))
