#include "client/sim/stability/round_number.h"

#include <array>
#include <charconv>

namespace needlelab {

double roundedTo(double value, int digits) {
  // through text, so that the result is the double that reading "0.0123" gives
  std::array<char, 40> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::scientific, digits - 1)
          .ptr;
  double rounded = 0;
  std::from_chars(text.data(), end, rounded);
  return rounded;
}

int significantDigits(double value) {
  std::array<char, 40> text{};
  const auto* end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::scientific).ptr;
  int digits = 0, upto_last_nonzero = 0;
  for (const char* c = text.data(); c != end && *c != 'e'; ++c) {
    if (*c < '0' || *c > '9') continue;
    ++digits;
    if (*c != '0') upto_last_nonzero = digits;
  }
  return upto_last_nonzero;
}

}  // namespace needlelab
