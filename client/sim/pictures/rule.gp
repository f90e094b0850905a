# The look of a rule's panel in the README: one message, letters that are read at a third of a page. Needs `png`, and
# `folder` with the study's tables.
width = 760; height = 600
load '../plots/style.gp'
set terminal pngcairo size width,height enhanced font 'DejaVu Sans,20' background '#ffffff'
set output png
set datafile separator ','
set title font 'DejaVu Sans Bold,22' textcolor rgb title_colour
set lmargin 9; set rmargin 3; set bmargin 3.5; set tmargin 2.5
unset key
