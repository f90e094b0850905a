#include <fmt/core.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "client/sim/stability/passivity_gesture.h"

namespace needlelab {
namespace {

using nlohmann::json;

Error wrong(const std::string& field, const std::string& text) {
  return {ErrorCode::kInvalidInput, field + ": " + text};
}

Status readNumber(const json& value, const std::string& field, NumberRange range, double& to) {
  if (!value.is_number()) return wrong(field, value.dump() + " is not a number");
  if (!range.contains(value.get<double>())) return outOfRange(field, value.get<double>(), range);
  to = value.get<double>();
  return {};
}

// `stroke` comes in as the one before
Status readStroke(const json& value, const std::string& where, PassivityStroke& stroke, bool is_start) {
  if (!value.is_object()) return wrong(where, "is not an object");
  if (!is_start && !value.contains("seconds")) return wrong(where + ".seconds", "is missing");
  for (const auto& [name, number] : value.items()) {
    const std::string field = where + "." + name;
    if (name == "kind" && !is_start) {
      const auto* const kind =
          number.is_string() ? std::find(kStrokeNames.begin(), kStrokeNames.end(), number.get<std::string>())
                             : kStrokeNames.end();
      if (kind == kStrokeNames.end()) return wrong(field, number.dump() + " is not a kind of stroke");
      stroke.kind = static_cast<StrokeKind>(kind - kStrokeNames.begin());
      continue;
    }
    const auto* const known = std::find_if(kStrokeFields.begin(), kStrokeFields.end(),
                                           [&name = name](const StrokeField& f) { return f.name == name; });
    if (known == kStrokeFields.end() || (is_start && name == "seconds")) return wrong(field, "is unknown");
    RETURN_IF_ERROR(readNumber(number, field, known->range, stroke.*known->member));
  }
  return {};
}

}  // namespace

Status readMotion(const json& motion, const std::string& where, PassivityGesture& gesture) {
  if (!motion.is_object()) return wrong(where, "is not an object");
  gesture.strokes.clear();
  gesture.start = {};
  gesture.start.kind = StrokeKind::kStart;
  for (const auto& [name, value] : motion.items())
    if (name != "start" && name != "strokes") return wrong(where + "." + name, "is unknown");
  // each stroke begins where the one before ended
  if (!motion.contains("start")) return wrong(where + ".start", "is missing");
  RETURN_IF_ERROR(readStroke(motion["start"], where + ".start", gesture.start, true));
  const auto strokes = motion.find("strokes");
  if (strokes == motion.end() || !strokes->is_array())
    return wrong(where + ".strokes", "is missing or no list");
  PassivityStroke stroke = gesture.start;
  for (std::size_t i = 0; i < strokes->size(); ++i) {
    stroke.kind = StrokeKind::kInsert;
    const std::string field = fmt::format("{}.strokes[{}]", where, i);
    RETURN_IF_ERROR(readStroke((*strokes)[i], field, stroke, false));
    gesture.strokes.push_back(stroke);
  }
  return {};
}

}  // namespace needlelab
