# Shades the phases of `phases` ("begin end NAME …") over the whole height of the plots that follow, and names them above
# the first; the time axis goes from `from_s` to `to_s`. Pale, so that lines stay readable.
phase_shade(name) = name eq 'INSERTING' ? '#e8f1fa' : name eq 'STOPPED' ? '#fdf3dc' : name eq 'WITHDRAWING' ? '#e9f5ec' : '#ffffff'
phase_text(name) = name eq 'INSERTING' ? 'insertion' : name eq 'STOPPED' ? 'stop' : name eq 'WITHDRAWING' ? 'withdrawal' : 'free motion'
letter_share = 0.0075    # of the axis, in the font below on a picture of 1200 pixels
do for [i = 1:words(phases)/3] {
  begin = word(phases, 3*i - 2) + 0
  end = word(phases, 3*i - 1) + 0
  name = word(phases, 3*i)
  set object i rectangle from first begin, graph 0 to first end, graph 1 behind fc rgb phase_shade(name) fs solid noborder
  left = begin < from_s ? from_s : begin
  right = end > to_s ? to_s : end
  # a name that has not enough room is left out
  if (right - left >= strlen(phase_text(name))*letter_share*(to_s - from_s)) {
    set label phase_text(name) at first (left + right)/2, graph 1.035 center font 'DejaVu Sans,11' textcolor rgb '#4a5560'
  }
}
