/// Smoothing with a symmetric kernel over a signal that is extended by point reflection about its ends.
/// Private to common/scoring. `Number` is double; tests use another type to count operations.
#pragma once

#include <cstddef>
#include <vector>

namespace needlelab {

/// The signal with `reach` additional values on either side, by point reflection about that end's value,
/// repeated if `reach` exceeds the signal's length. Equals, bit for bit, reflecting an index step by step
/// until it is inside, but takes only 2 operations per value and 3 per reflection. A single value is
/// repeated.
template <typename Number>
std::vector<Number> reflected(const std::vector<Number>& values, std::size_t reach) {
  if (values.size() < 2)
    return std::vector<Number>(values.empty() ? 0 : 2 * reach + 1, values.empty() ? Number() : values[0]);
  const std::size_t span = values.size() - 1;
  std::vector<Number> all(values.size() + 2 * reach);
  for (std::size_t i = 0; i <= span; ++i) all[reach + i] = Number(0) + Number(1) * values[i];
  for (const bool left : {true, false}) {
    Number offset(0), sign(1);
    bool about_first = !left;  // toggled before it is used
    for (std::size_t k = 1; k <= reach; ++k) {
      // after each signal length, one more reflection, about the other end
      const std::size_t in = (k - 1) % span + 1;
      if (in == 1) {
        about_first = !about_first;
        offset = offset + sign * Number(2) * (about_first ? values.front() : values.back());
        sign = -sign;
      }
      const Number value = offset + sign * values[about_first ? in : span - in];
      all[left ? reach - k : reach + span + k] = value;
    }
  }
  return all;
}

/// Means weighted by a kernel; `half` is its middle and one side (at least the middle). Operations: those of
/// `reflected`, and 3 for each value and weight.
template <typename Number>
std::vector<Number> smoothed(const std::vector<Number>& values, const std::vector<Number>& half) {
  const std::size_t reach = half.size() - 1;
  const std::vector<Number> all = reflected(values, reach);
  std::vector<Number> result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    Number sum = half[0] * values[i];
    for (std::size_t k = 1; k <= reach; ++k) sum = sum + half[k] * (all[reach + i - k] + all[reach + i + k]);
    result[i] = sum;
  }
  return result;
}

}  // namespace needlelab
