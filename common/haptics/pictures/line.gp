# usage: gnuplot -e "out='line.png'" line.gp
set terminal pngcairo size 1200,480 font 'DejaVu Sans,11'
set output out
load system("dirname ".ARG0)."/style.gp"
set multiplot layout 1,2
set samples 400

# eq. 8 with 9000 N/m² of lateral stiffness, 400 N/m and 4 N at most, and the angle β up to which it holds u (FORCE_MODEL.md,
# "Change of trajectory") for a needle of 60 mm whose axis follows the tip
set title 'Clamping: deeper is stiffer, and the line turns later' font 'DejaVu Sans,13'
set xlabel 'aside from the line, |e| [mm]'
set ylabel 'force toward the line [N]'
set xrange [0:30]; set yrange [0:5]
set key top left samplen 2
k(d) = 9.0*d < 400 ? 9.0*d : 400.0
least(a, b) = a < b ? a : b
tangent(d) = least(1.0, 1e-4 + (d/60.0)**2)
f(e, d) = least(least(k(d)*e/1000, 4.0), k(d)*d*tangent(d)/sqrt(1 + tangent(d)**2)/1000)
set label 1 'f_{max}' at 27.5,4.22 tc rgb quiet
set label 2 'from here the line turns' at 9,2.15 tc rgb quiet
plot f(x, 20) lw 2.5 lc rgb '#a9cce3' title '20 mm deep, k = 180 N/m', f(x, 30) lw 2.5 lc rgb '#5499c7' title '30 mm, 270 N/m', \
     f(x, 40) lw 2.5 lc rgb needle title '40 mm, 360 N/m'
unset label 2; unset label 1

# eq. 7
set title 'α limits the tilt, β holds the line (L = 60 mm)' font 'DejaVu Sans,13'
set xlabel 'inserted length d_t [mm]'
set ylabel 'angle [°]'
set xrange [0:60]; set yrange [0:60]
set key off
set angles degrees
alpha(d) = atan((60.0-d)/(60.0+d))
set label 1 'tilted beyond α: torque' at 14,42 tc rgb quiet
set label 2 'tip beyond β: the line turns toward the axis' at 3,56 tc rgb quiet
set key at 59,52 right samplen 2
plot alpha(x) lw 2.5 lc rgb needle title 'α', atan(tangent(x)) lw 2.5 lc rgb '#5499c7' title 'β'
unset multiplot
