set grid lc rgb '#d8dde3'
set border 3 lc rgb '#606a75'
set xtics nomirror
set ytics nomirror
set style fill solid 1 noborder
needle = '#1b4f72'
wall = '#d1495b'
quiet = '#606a75'
