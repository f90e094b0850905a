/// Numbers as a person would write them: few significant digits.
#pragma once

namespace needlelab {

/// `value` with at most `digits` (1-15) significant decimal digits: the double nearest to that decimal.
double roundedTo(double value, int digits);
/// How many significant decimal digits its shortest text has: 0 for 0, 1 for 300 or 0.02, 3 for 0.125.
int significantDigits(double value);

}  // namespace needlelab
