# The look of every picture. Loaded with `width` and `height` in pixels; needs `png`, the picture's path.
# To draw a picture by hand, in this folder:
#   gnuplot -e "csv = '…/fig09.csv'; png = 'fig09.png'; phases = ''; array layer_s[1] = [0]" fig09.gp
set terminal pngcairo size width,height enhanced font 'DejaVu Sans,13' background '#ffffff'
set encoding utf8
set output png
set datafile missing 'nan'
set border 3 lc rgb '#4a5560' lw 1.2
set tics nomirror out scale 0.6 textcolor rgb '#2b333b'
set grid back lc rgb '#d9dee3' lw 0.8 dt 1
set style line 1 lc rgb '#1f5fa8' lw 2.4              # the needle
set style line 2 lc rgb '#e07b1f' lw 2.4 dt (12,5)    # the wall
set style line 3 lc rgb '#c0303b' lw 2.4              # cutting
set style line 4 lc rgb '#2a8a4a' lw 2.4              # attracted
set style line 5 lc rgb '#d6338a' lw 2.0              # clamping
set style line 6 lc rgb '#7d8790' lw 1.2 dt (4,4)     # thin grey
set key box lc rgb '#c9d0d6' lw 0.8 opaque samplen 2.6 spacing 1.25 width 1 height 0.4 textcolor rgb '#2b333b'
set xlabel textcolor rgb '#2b333b'
set ylabel textcolor rgb '#2b333b'
text_colour = '#2b333b'
title_font = 'DejaVu Sans Bold,16'
title_colour = '#1c2329'
shade_colour = '#ecf0f4'    # behind what was held out

# Okabe and Ito (2008): told apart by colour-blind people; 1 to 7: blue, vermilion, green, purple, orange, sky, black
array safe_colour[7] = ['#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#20262c']
