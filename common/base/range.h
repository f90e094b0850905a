/// Ranges of allowed numbers, and the one error text for a number out of range.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

/// The interval [min, max]; each end may be open. NaN and infinities are never in range.
struct NumberRange {
  double min = 0;
  double max = 0;
  bool min_open = false;
  bool max_open = false;

  [[nodiscard]] bool contains(double value) const {
    return std::isfinite(value) && (min_open ? value > min : value >= min) &&
           (max_open ? value < max : value <= max);
  }
};

/// The shortest text that reads back as the same double; "nan", "inf" or "-inf" for non-finite numbers.
inline std::string numberText(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

/// e.g. "(0, 50]"
inline std::string rangeText(const NumberRange& range) {
  return (range.min_open ? "(" : "[") + numberText(range.min) + ", " + numberText(range.max) +
         (range.max_open ? ")" : "]");
}

/// e.g. "layers[2].cutting_force_n: 75 is out of range [0, 50]"
inline Error outOfRange(std::string_view field, double value, const NumberRange& range) {
  return {ErrorCode::kInvalidInput,
          std::string(field) + ": " + numberText(value) + " is out of range " + rangeText(range)};
}

}  // namespace needlelab
