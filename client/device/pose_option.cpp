#include "client/device/pose_option.h"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "common/base/files/files.h"
#include "common/base/range.h"
#include "common/base/text/csv.h"
#include "common/base/text/csv_rows.h"

namespace needlelab {
namespace {

using Numbers = std::array<double, 7>;
constexpr std::array<const char*, 7> kNames = {"x", "y", "z", "qx", "qy", "qz", "qw"};

Result<Pose> checked(const Numbers& v, const std::string& where, Quantity reach) {
  for (std::size_t i = 0; i < v.size(); ++i)
    if (const NumberRange range{-1.001, 1.001}; !std::isfinite(v[i]) || (i >= 3 && !range.contains(v[i])))
      return outOfRange(where + ": " + kNames[i], v[i], range);
  RETURN_IF_ERROR(
      checkPlausible(where + ": the distance from the origin", reach, std::hypot(v[0], v[1], v[2])));
  const Quat q{v[3], v[4], v[5], v[6]};
  if (const double length = std::sqrt(dot(q, q)); !(std::abs(length - 1) <= 1e-3))
    return outOfRange(where + ": length of the quaternion", length, {0.999, 1.001});
  return Pose{{v[0], v[1], v[2]}, normalized(q)};
}

Result<Pose> fromNumbers(std::string_view text, const std::string& option, Quantity reach) {
  Numbers v{};
  std::size_t count = 0;
  for (bool more = true; more; ++count) {
    const std::size_t comma = text.find(',');
    const std::string_view cell = text.substr(0, comma);
    more = comma != std::string_view::npos;
    if (more) text.remove_prefix(comma + 1);
    const auto value = numberOf(cell);
    if (!value)
      return Error{ErrorCode::kInvalidInput,
                   option + ": '" + std::string(cell.substr(0, 40)) +
                       "' is not a number; x,y,z,qx,qy,qz,qw or a JSON file is expected"};
    if (count < v.size()) v[count] = *value;
  }
  if (count != v.size())
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: {} numbers, the seven x,y,z,qx,qy,qz,qw are expected", option, count)};
  return checked(v, option, reach);
}

Result<Pose> fromFile(const std::string& path, const std::string& option, Quantity reach) {
  const std::string where = option + ": " + path;
  const auto text = readWholeFile(path, 64u << 10);
  if (!text.ok()) return Error{text.error().code, option + ": " + text.error().message};
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  const auto fail = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, where + ": " + why};
  };
  if (!json.is_object()) return fail("is not a JSON object");
  Numbers v{};
  const struct {
    const char* name;
    std::array<const char*, 4> parts;
    std::size_t count, at;
  } groups[] = {{"position_m", {"x", "y", "z", nullptr}, 3, 0}, {"quaternion", {"x", "y", "z", "w"}, 4, 3}};
  for (const auto& [key, value] : json.items())
    // the file's origin is for people only
    if (key != groups[0].name && key != groups[1].name && !(key == "calibration" && value.is_object()))
      return fail("field '" + key.substr(0, 40) +
                  "' is unknown; position_m and quaternion (and perhaps calibration) are expected");
  for (const auto& group : groups) {
    const auto found = json.find(group.name);
    if (found == json.end() || !found->is_object() || found->size() != group.count)
      return fail(fmt::format("{} must be an object of {} numbers", group.name, group.count));
    for (std::size_t i = 0; i < group.count; ++i) {
      const auto number = found->find(group.parts[i]);
      if (number == found->end() || !number->is_number())
        return fail(std::string(group.name) + "." + group.parts[i] + ": a number is missing");
      v[group.at + i] = number->get<double>();
    }
  }
  return checked(v, where, reach);
}

Numbers numbersOf(const Pose& pose) {
  return {pose.p.x, pose.p.y, pose.p.z, pose.q.x, pose.q.y, pose.q.z, pose.q.w};
}

}  // namespace

Result<Pose> parsePoseOption(const std::string& text, const std::string& option, Quantity reach) {
  // a list of numbers has commas and no character that only a file name has
  const bool numbers = text.find(',') != std::string::npos &&
                       text.find_first_not_of("0123456789+-.,eE \u2212") == std::string::npos;
  return numbers ? fromNumbers(text, option, reach) : fromFile(text, option, reach);
}

std::string poseOptionText(const Pose& pose) {
  std::string text;
  for (const double value : numbersOf(pose)) {
    if (!text.empty()) text += ',';
    appendNumber(text, value);
  }
  return text;
}

std::string poseOptionJson(const Pose& pose) {
  const nlohmann::ordered_json json = {
      {"position_m", {{"x", pose.p.x}, {"y", pose.p.y}, {"z", pose.p.z}}},
      {"quaternion", {{"x", pose.q.x}, {"y", pose.q.y}, {"z", pose.q.z}, {"w", pose.q.w}}}};
  return json.dump(2) + "\n";
}

}  // namespace needlelab
