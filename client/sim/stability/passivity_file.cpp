#include "client/sim/stability/passivity_file.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "common/base/range.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

struct Field {
  const char* name;
  double PassivityStroke::*member;
  NumberRange range;
};
constexpr std::array<Field, 6> kFields = {{{"x_m", &PassivityStroke::x_m, {-1, 1}},
                                           {"y_m", &PassivityStroke::y_m, {-1, 1}},
                                           {"depth_m", &PassivityStroke::depth_m, {-1, 1}},
                                           {"tilt_x", &PassivityStroke::tilt_x, {-1000, 1000}},
                                           {"tilt_y", &PassivityStroke::tilt_y, {-1000, 1000}},
                                           {"seconds", &PassivityStroke::seconds, {1e-3, 600}}}};

Error wrong(const std::string& field, const std::string& words) {
  return {ErrorCode::kInvalidInput, field + ": " + words};
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
    const auto* const known = std::find_if(kFields.begin(), kFields.end(),
                                           [&name = name](const Field& f) { return f.name == name; });
    if (known == kFields.end() || (is_start && name == "seconds")) return wrong(field, "is unknown");
    if (Status status = readNumber(number, field, known->range, stroke.*known->member); !status.ok())
      return status;
  }
  return {};
}

std::string strokeJson(const PassivityStroke& stroke, const PassivityStroke* before) {
  ordered_json line;
  if (before != nullptr) line["kind"] = kStrokeNames[static_cast<std::size_t>(stroke.kind)];
  for (const Field& field : kFields) {
    const bool is_time = field.member == &PassivityStroke::seconds;
    if (before == nullptr ? !is_time : is_time || stroke.*field.member != before->*field.member)
      line[field.name] = stroke.*field.member;
  }
  return line.dump();
}

std::string indented(const std::string& text, const std::string& by) {
  std::string out;
  for (const char c : text) {
    out += c;
    if (c == '\n') out += by;
  }
  return out;
}

Status readFound(const json& found, const std::string& where, CounterExample& example) {
  const auto text = [&](const char* name) {
    const auto field = found.find(name);
    return field != found.end() && field->is_string() ? field->get<std::string>() : std::string();
  };
  example.source = text("source");
  const auto* const model = std::find(kAxialModelNames.begin(), kAxialModelNames.end(), text("model"));
  if (model == kAxialModelNames.end()) return wrong(where + ".model", "'" + text("model") + "' is no model");
  example.model = static_cast<AxialModel>(model - kAxialModelNames.begin());
  const auto* const check =
      std::find(kPassivityCheckNames.begin(), kPassivityCheckNames.end(), text("check"));
  if (check == kPassivityCheckNames.end())
    return wrong(where + ".check", "'" + text("check") + "' is no check");
  example.finding.check = static_cast<PassivityCheck>(check - kPassivityCheckNames.begin());
  const auto seed = found.find("seed");
  if (seed == found.end() || !seed->is_number_unsigned())
    return wrong(where + ".seed", "is missing or no whole number");
  example.seed = seed->get<std::uint64_t>();
  const auto number = [&](const char* name, double& to) -> Status {
    const auto field = found.find(name);
    if (field == found.end()) return wrong(where + "." + name, "is missing");
    return readNumber(*field, where + "." + name, {-1e9, 1e9}, to);
  };
  if (Status status = number("measured", example.finding.measured); !status.ok()) return status;
  return number("limit", example.finding.limit);
}

}  // namespace

std::string counterExampleJson(const CounterExample& example) {
  const PassivityGesture& gesture = example.gesture;
  const ordered_json found = {
      {"source", example.source},
      {"model", axialModelName(example.model)},
      {"seed", example.seed},
      {"check", kPassivityCheckNames[static_cast<std::size_t>(example.finding.check)]},
      {"measured", example.finding.measured},
      {"limit", example.finding.limit}};
  std::string text = "{\n  \"found\": " + indented(found.dump(2), "  ") + ",\n  \"motion\": {\n";
  text += "    \"rate_hz\": " + json(gesture.rate_hz).dump() + ",\n";
  text += "    \"tremor_m\": " + json(gesture.tremor_m).dump() +
          ", \"tremor_seed\": " + json(gesture.tremor_seed).dump() + ",\n";
  text += "    \"encoder_step_m\": " + json(gesture.encoder_step_m).dump() + ",\n";
  text += "    \"start\": " + strokeJson(gesture.start, nullptr) + ",\n    \"strokes\": [";
  const PassivityStroke* before = &gesture.start;
  for (const PassivityStroke& stroke : gesture.strokes) {
    text += (before == &gesture.start ? "\n      " : ",\n      ") + strokeJson(stroke, before);
    before = &stroke;
  }
  std::string profile = profileJson(gesture.profile);
  if (!profile.empty() && profile.back() == '\n') profile.pop_back();
  return text + "\n    ]\n  },\n  \"profile\": " + indented(profile, "  ") + "\n}\n";
}

Status readMotion(const json& motion, const std::string& where, PassivityGesture& gesture) {
  if (!motion.is_object()) return wrong(where, "is not an object");
  gesture.strokes.clear();
  gesture.start = {};
  gesture.start.kind = StrokeKind::kStart;
  for (const auto& [name, value] : motion.items()) {
    const std::string field = where + "." + name;
    Status status;
    if (name == "rate_hz") {
      status = readNumber(value, field, {kMinRateHz, kMaxRateHz}, gesture.rate_hz);
    } else if (name == "tremor_m") {
      status = readNumber(value, field, {0, 0.005}, gesture.tremor_m);
    } else if (name == "encoder_step_m") {
      status = readNumber(value, field, {0, 0.001}, gesture.encoder_step_m);
    } else if (name == "tremor_seed") {
      if (!value.is_number_unsigned()) return wrong(field, value.dump() + " is no whole number");
      gesture.tremor_seed = value.get<std::uint64_t>();
    } else if (name != "start" && name != "strokes") {
      return wrong(field, "is unknown");
    }
    if (!status.ok()) return status;
  }

  // each stroke begins with what the one before ended with
  if (!motion.contains("start")) return wrong(where + ".start", "is missing");
  if (Status status = readStroke(motion["start"], where + ".start", gesture.start, true); !status.ok())
    return status;
  const auto strokes = motion.find("strokes");
  if (strokes == motion.end() || !strokes->is_array())
    return wrong(where + ".strokes", "is missing or no list");
  PassivityStroke stroke = gesture.start;
  for (std::size_t i = 0; i < strokes->size(); ++i) {
    stroke.kind = StrokeKind::kInsert;
    const std::string field = where + ".strokes[" + std::to_string(i) + "]";
    if (Status status = readStroke((*strokes)[i], field, stroke, false); !status.ok()) return status;
    gesture.strokes.push_back(stroke);
  }
  return {};
}

Result<CounterExample> parseCounterExample(std::string_view text, std::string_view source) {
  const std::string name(source);
  const json whole = json::parse(text, nullptr, false);
  if (whole.is_discarded()) return wrong(name, "is not JSON");
  if (!whole.is_object()) return wrong(name, "is not an object");
  for (const char* section : {"found", "motion", "profile"})
    if (!whole.contains(section) || !whole[section].is_object())
      return wrong(name + ": " + section, "is missing or no object");
  CounterExample example;
  if (Status status = readFound(whole["found"], name + ": found", example); !status.ok())
    return status.error();
  if (Status status = readMotion(whole["motion"], name + ": motion", example.gesture); !status.ok())
    return status.error();
  auto profile = parseProfile(whole["profile"].dump(), name + ": profile");
  if (!profile.ok()) return profile.error();
  example.gesture.profile = *std::move(profile);
  return example;
}

Result<CounterExample> loadCounterExample(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return Error{ErrorCode::kInvalidInput, path.string() + ": cannot be read"};
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return parseCounterExample(text, path.string());
}

}  // namespace needlelab
