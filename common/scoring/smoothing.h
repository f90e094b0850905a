/// Smoothing by a symmetric kernel over a signal that is continued by its point reflections about its ends.
/// Private to this folder. `Number` is double; tests count with another.
#pragma once

#include <cstddef>
#include <vector>

namespace needlelab {

/// The signal with `reach` values more on either side: the point reflection about that end's value, again and
/// again where `reach` is greater than the signal is long. Bit for bit what one gets by reflecting a place
/// step by step until it is inside; in 2 operations a value and 3 a reflection. A single value goes on as it
/// is.
template <typename Number>
std::vector<Number> reflected(const std::vector<Number>& values, std::size_t reach) {
  if (values.size() < 2)
    return std::vector<Number>(values.empty() ? 0 : 2 * reach + 1, values.empty() ? Number() : values[0]);
  const std::size_t span = values.size() - 1;
  std::vector<Number> all(values.size() + 2 * reach);
  for (std::size_t i = 0; i <= span; ++i) all[reach + i] = Number(0) + Number(1) * values[i];
  for (const bool left : {true, false}) {
    Number offset(0), sign(1);
    bool about_first = !left;  // turned before it is used
    for (std::size_t k = 1; k <= reach; ++k) {
      // after each length of the signal one reflection more, about the other end
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

/// Means weighted by a kernel, of which `half` is the middle and one side (at least the middle). Operations:
/// those of `reflected`, and 3 for each value and weight.
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
