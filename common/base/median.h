/// The median of a list.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace needlelab {

/// `values` must not be empty. For an even number of values, returns the upper of the two middle ones.
template <typename T>
[[nodiscard]] T medianOf(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace needlelab
