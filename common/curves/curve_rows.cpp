#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/curves/curve_set.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxOptionBytes = 1u << 16;
constexpr double kMaxLinesAbove = 1000;
constexpr std::array<std::pair<const char*, double>, 4> kForceUnits = {
    {{"N", 1}, {"mN", 1e-3}, {"gf", 9.80665e-3}, {"kgf", 9.80665}}};

Error wrongOption(const std::string& field, const nlohmann::json& value, const char* allowed) {
  return wrongInput(field, fmt::format("{} is not {}", printable(value.dump()), allowed));
}

}  // namespace

Result<CurveOptions> parseCurveOptions(std::string_view text) {
  ASSIGN_OR_RETURN(const auto json, readStrictJson(text, "options", kMaxOptionBytes));
  if (!json.is_object()) return wrongInput("options", "must be an object");
  CurveOptions options;
  CurveReading& reading = options.reading;
  for (const auto& item : json.items()) {
    const std::string& field = item.key();
    const nlohmann::json& value = item.value();
    if (field == "tare" || field == "digitised") {
      if (!value.is_boolean()) return wrongOption(field, value, "true or false");
      (field == "tare" ? reading.tare : reading.digitised) = value.get<bool>();
    } else if (field == "describe") {
      if (!value.is_string()) return wrongOption(field, value, "the path of a file");
      options.description = value.get<std::string>();
    } else if (field == "encoding") {
      if (value != kEncodingNames[0] && value != kEncodingNames[1])
        return wrongOption(field, value, "unicode or windows-1252");
      if (value == kEncodingNames[1]) reading.encoding = TextEncoding::kWindows1252;
    } else if (field == "lines_above") {
      if (!value.is_number_integer() || !(value.get<double>() >= 0 && value.get<double>() <= kMaxLinesAbove))
        return wrongOption(field, value, "a whole number from 0 to 1000");
      reading.lines_above = value.get<std::size_t>();
    } else if (field == "force_unit") {
      const auto* const unit = std::find_if(kForceUnits.begin(), kForceUnits.end(),
                                            [&](const auto& one) { return value == one.first; });
      if (unit == kForceUnits.end()) return wrongOption(field, value, "one of N, mN, gf, kgf");
      reading.force_unit_N = unit->second;
    } else if (field == "negate") {
      if (!value.is_array()) return wrongOption(field, value, R"(a list of "depth" and "force")");
      for (const auto& what : value) {
        if (what != "depth" && what != "force") return wrongOption(field, what, "depth or force");
        (what == "depth" ? reading.negate_depth : reading.negate_force) = true;
      }
    } else {
      return wrongInput("options", fmt::format("unknown field {}; known fields are describe, digitised, "
                                               "encoding, force_unit, lines_above, negate, tare",
                                               quotedText(field)));
    }
  }
  return options;
}

CurveColumns columnsOf(const ForceCurve& curve) {
  CurveColumns rows{curve.depth_m, curve.force_N, {}, {}};
  for (const double depth_m : curve.depth_m)
    rows.t_s.push_back((depth_m - curve.depth_m.front()) / curve.speed_mps);
  rows.phase.resize(rows.depth_m.size(), CurvePhase::kInsert);
  const auto add = [&](CurvePhase phase, double t_s, double depth_m, double force_N) {
    rows.phase.push_back(phase);
    rows.t_s.push_back(t_s);
    rows.depth_m.push_back(depth_m);
    rows.force_N.push_back(force_N);
  };
  const double stopped_s = rows.t_s.back();
  for (std::size_t i = 0; i < curve.hold.t_s.size(); ++i)
    add(CurvePhase::kHold, stopped_s + curve.hold.t_s[i], curve.hold.depth_m, curve.hold.force_N[i]);
  const CurveWithdrawal& out = curve.withdrawal;
  const double turned_s = rows.t_s.back();
  for (std::size_t i = out.depth_m.size(); i-- > 0;)
    add(CurvePhase::kWithdraw, turned_s + (out.depth_m.back() - out.depth_m[i]) / out.speed_mps,
        out.depth_m[i], out.force_N[i]);
  return rows;
}

}  // namespace needlelab
