/// Units for people: degrees, and the unit in which a quantity in SI is shown. client/web/app/lib/units.js
/// has the same units for the browser. Pure: any thread.
#pragma once

#include <array>
#include <numbers>
#include <string_view>

namespace needlelab {

inline constexpr double kDegreesPerRad = 180 / std::numbers::pi;

constexpr double radOf(double degrees) {
  return degrees * std::numbers::pi / 180;
}

constexpr double degreesOf(double rad) {
  return rad * 180 / std::numbers::pi;
}

struct ShownUnit {
  double per_si = 1;  ///< shown value = value in SI * per_si
  std::string_view name;
};

/// `unit`: "m", "m/s", "m^2", "J", "rad". Any other is shown as it is; the result then refers to `unit`.
constexpr ShownUnit shownUnitOf(std::string_view unit) {
  struct Row {
    std::string_view unit;
    ShownUnit shown;
  };
  constexpr std::array kRows = {Row{"m", {1e3, "mm"}}, Row{"m/s", {1e3, "mm/s"}}, Row{"m^2", {1e4, "cm²"}},
                                Row{"J", {1e3, "mJ"}}, Row{"rad", {kDegreesPerRad, "°"}}};
  for (const Row& row : kRows)
    if (row.unit == unit) return row.shown;
  return {1, unit};
}

}  // namespace needlelab
