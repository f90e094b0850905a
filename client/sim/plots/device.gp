# A device in each patient: the share of neighbours that stay stable, with its interval. `data`: block `patients` (row,
# share, low, high, 1 where enough are stable, name and stiffness); `finding`: the title.
set datafile separator "\t"
stats data index 'patients;' using 1 nooutput
patients = STATS_records
width = 1000; height = 130 + 34*patients
load 'style.gp'
unset key
set grid x
set lmargin at screen 0.36
set rmargin at screen 0.97
set bmargin at screen 70.0/height
set tmargin at screen 1 - 50.0/height
set xrange [0:1.02]
set yrange [patients - 0.4:-0.6]
set xtics ('0 %%' 0, '25 %%' 0.25, '50 %%' 0.5, '75 %%' 0.75, '100 %%' 1)
set ytics out nomirror
set xlabel 'neighbours of a light grip at rest that stay stable, with 95 % interval'
set label 1 finding at screen 0.5, 1 - 24.0/height center noenhanced font 'DejaVu Sans Bold,13' textcolor rgb title_colour
colour(ok) = ok == 1 ? 0x5b9bd5 : 0xf6b26b
plot data index 'patients;' using (0.5*$2):1:(0.5*$2):(0.32):(colour($5)):ytic(6) with boxxyerror lc rgb variable fillstyle solid 0.9 noborder, \
     '' index 'patients;' using 2:1:3:4 with xerrorbars pt 7 ps 0.5 lw 1.5 lc rgb text_colour
