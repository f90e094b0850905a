# usage: gnuplot -e "out='line.png'" line.gp
set terminal pngcairo size 1200,480 font 'DejaVu Sans,11'
set output out
load system("dirname ".ARG0)."/style.gp"
set multiplot layout 1,2
set samples 400

# eq. 8 with 9000 N/m² of lateral stiffness, 400 N/m and 4 N at most, and the force up to which it holds u (FORCE_MODEL.md,
# "Change of trajectory") for a needle of 60 mm: from 5 mm on it grows to f_max at half the needle
set title 'Clamping: deeper is stiffer, and the line turns later' font 'DejaVu Sans,13'
set xlabel 'aside from the line, |e| [mm]'
set ylabel 'force toward the line [N]'
set xrange [0:30]; set yrange [0:5]
set key top left samplen 2
k(d) = 9.0*d < 400 ? 9.0*d : 400.0
least(a, b) = a < b ? a : b
turns(d) = least(4.0, least(4.0*(d-5)/25.0, k(d)*4.0/k(30.0)))
f(e, d) = least(k(d)*e/1000, turns(d))
set label 1 'f_{max}' at 27.5,4.22 tc rgb quiet
set label 2 'from here the line turns' at 14,0.98 tc rgb quiet
plot f(x, 10) lw 2.5 lc rgb '#a9cce3' title '10 mm deep, k = 90 N/m', f(x, 20) lw 2.5 lc rgb '#5499c7' title '20 mm, 180 N/m', \
     f(x, 40) lw 2.5 lc rgb needle title '40 mm, 360 N/m'
unset label 2; unset label 1

# eq. 7
set title 'Orientation: the cone α narrows with depth (L = 60 mm)' font 'DejaVu Sans,13'
set xlabel 'inserted length d_t [mm]'
set ylabel 'allowed tilt α [°]'
set xrange [0:60]; set yrange [0:60]
set key off
set angles degrees
alpha(d) = atan((60.0-d)/(60.0+d))
do for [i=0:3] {
  d = 7 + 13*i
  a = alpha(d)
  set arrow 10+2*i from d,3 to d+10*sin(a)*0.8,3+20*cos(a)*0.8 nohead lc rgb '#e09f3e' lw 2
  set arrow 11+2*i from d,3 to d-10*sin(a)*0.8,3+20*cos(a)*0.8 nohead lc rgb '#e09f3e' lw 2
}
set label 1 'torque only beyond it' at 26,50 tc rgb quiet
plot alpha(x) lw 2.5 lc rgb needle
unset multiplot
