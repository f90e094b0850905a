/// How a field's distances are joined, and which parts of it matter. Internal to the field.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/anatomy/field.h"

namespace needlelab {

inline constexpr double kFar_m = 1e3;  // no part of the group is near

/// A distance with its slope, as a number: rules and joins are written once for both.
struct Sloped {
  double value_m = 0;
  Vec3 slope;
  Sloped() = default;
  Sloped(double value) : value_m(value) {}  // NOLINT: a number that does not change
  Sloped(double value, Vec3 change) : value_m(value), slope(change) {}
  Sloped operator-() const { return {-value_m, slope * -1.0}; }
  friend Sloped operator-(const Sloped& a, const Sloped& b) {
    return {a.value_m - b.value_m, a.slope - b.slope};
  }
  friend Sloped operator*(const Sloped& a, const Sloped& b) {
    return {a.value_m * b.value_m, a.slope * b.value_m + b.slope * a.value_m};
  }
  friend Sloped operator/(const Sloped& a, double b) { return {a.value_m / b, a.slope / b}; }
  friend bool operator<(const Sloped& a, const Sloped& b) { return a.value_m < b.value_m; }
  friend bool operator>(const Sloped& a, const Sloped& b) { return a.value_m > b.value_m; }
};
inline Sloped fabs(const Sloped& a) {
  return a.value_m < 0 ? -a : a;
}

template <class Number>
Number smoothMinimum(const Number& a, const Number& b, double blend_m) noexcept {
  using std::fabs;
  const Number least = std::min(a, b);
  const Number overlap = blend_m - fabs(a - b);
  return overlap > Number(0.0) ? least - overlap * overlap / (4 * blend_m) : least;
}

/// Which parts matter to any rule in some region. Parts are shown from the last to the first, with the bounds
/// of their distances there. A group's value joins its parts in order: behind the last part it matters up to
/// v = ruled_m. Before a part with distance d and blend k it matters up to v + k, because a smooth minimum is
/// at least max(a, d) − k where it blends; and not above d + k, where the part alone decides. A part that is
/// always above v + k is left out: it does not change a value up to v, and leaves others above v.
class Field::Mattering {
 public:
  /// `beyond_rules`: v is unbounded, so that no value changes.
  explicit Mattering(bool beyond_rules = false) : beyond_rules_(beyond_rules) {}
  bool matters(const Part& part, double low_m, double high_m) noexcept {
    if (part.group != group_) {
      group_ = part.group;
      up_to_m_ = beyond_rules_ ? kInfinity : part.ruled_m;
    }
    if (low_m > up_to_m_ + part.blend_m) return false;
    up_to_m_ = std::min(up_to_m_, high_m) + part.blend_m;
    return true;
  }

 private:
  bool beyond_rules_;
  unsigned group_ = kMaxFieldGroups;
  double up_to_m_ = 0;
};

}  // namespace needlelab
