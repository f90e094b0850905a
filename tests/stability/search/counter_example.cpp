#include "tests/stability/search/counter_example.h"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "common/base/range.h"
#include "common/haptics/scene_spec.h"
#include "common/profile/profile.h"
#include "tests/stability/search/shrink.h"

namespace needlelab::test {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

Error wrong(const std::string& field, const std::string& text) {
  return {ErrorCode::kInvalidInput, field + ": " + text};
}

std::string strokeJson(const PassivityStroke& stroke, const PassivityStroke* before) {
  ordered_json line;
  if (before != nullptr) line["kind"] = kStrokeNames[static_cast<std::size_t>(stroke.kind)];
  for (const StrokeField& field : kStrokeFields) {
    const bool is_time = field.member == &PassivityStroke::seconds;
    if (before == nullptr ? !is_time : is_time || stroke.*field.member != before->*field.member)
      line[std::string(field.name)] = stroke.*field.member;
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
  if (model == kAxialModelNames.end())
    return wrong(where + ".model", "'" + text("model") + "' is not a model");
  example.model = static_cast<AxialModel>(model - kAxialModelNames.begin());
  const auto* const check =
      std::find(kPassivityCheckNames.begin(), kPassivityCheckNames.end(), text("check"));
  if (check == kPassivityCheckNames.end())
    return wrong(where + ".check", "'" + text("check") + "' is not a check");
  example.finding.check = static_cast<PassivityCheck>(check - kPassivityCheckNames.begin());
  const auto seed = found.find("seed");
  if (seed == found.end() || !seed->is_number_unsigned())
    return wrong(where + ".seed", "is missing or no whole number");
  example.seed = seed->get<std::uint64_t>();
  const auto number = [&](const char* name, double& to) -> Status {
    const auto field = found.find(name);
    if (field == found.end() || !field->is_number())
      return wrong(where + "." + name, "is missing or no number");
    to = field->get<double>();
    return {};
  };
  RETURN_IF_ERROR(number("measured", example.finding.measured));
  return number("limit", example.finding.limit);
}

// the numbers in a file other than the strokes
Status readSampling(json& motion, const std::string& where, PassivityGesture& gesture) {
  struct Field {
    const char* name;
    double* value;
    NumberRange range;
  };
  double seed = 1;
  for (const auto& [name, value, range] : {Field{"rate_hz", &gesture.rate_hz, {kMinRateHz, kMaxRateHz}},
                                           Field{"tremor_m", &gesture.tremor_m, {0, 0.005}},
                                           Field{"encoder_step_m", &gesture.encoder_step_m, {0, 0.001}},
                                           Field{"tremor_seed", &seed, {0, 1e9}}}) {
    const auto found = motion.find(name);
    if (found == motion.end()) continue;
    if (!found->is_number()) return wrong(where + "." + name, found->dump() + " is not a number");
    *value = found->get<double>();
    if (!range.contains(*value)) return outOfRange(where + "." + name, *value, range);
    motion.erase(found);
  }
  gesture.tremor_seed = static_cast<std::uint64_t>(seed);
  return {};
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

Result<CounterExample> parseCounterExample(std::string_view text, std::string_view source) {
  const std::string name(source);
  json whole = json::parse(text, nullptr, false);
  if (whole.is_discarded()) return wrong(name, "is not JSON");
  if (!whole.is_object()) return wrong(name, "is not an object");
  for (const char* section : {"found", "motion", "profile"})
    if (!whole.contains(section) || !whole[section].is_object())
      return wrong(name + ": " + section, "is missing or no object");
  CounterExample example;
  RETURN_IF_ERROR(readFound(whole["found"], name + ": found", example));
  RETURN_IF_ERROR(readSampling(whole["motion"], name + ": motion", example.gesture));
  RETURN_IF_ERROR(readMotion(whole["motion"], name + ": motion", example.gesture));
  ASSIGN_OR_RETURN(auto profile, parseProfile(whole["profile"].dump(), name + ": profile"));
  example.gesture.profile = std::move(profile);
  return example;
}

Result<CounterExample> loadCounterExample(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return Error{ErrorCode::kInvalidInput, path.string() + ": cannot be read"};
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return parseCounterExample(text, path.string());
}

Result<std::vector<CounterExample>> counterExamples(const GestureSearch& search, std::string_view source_name,
                                                    AxialModel model, const ForceSourceFactory& source,
                                                    std::size_t most) {
  std::vector<CounterExample> examples;
  const auto keep = [&](std::uint64_t seed, const PassivityGesture& gesture,
                        const PassivityFinding& finding) {
    const auto found = [&](const PassivityGesture& candidate) -> std::optional<PassivityFinding> {
      const auto record = runGesture(candidate, model, source);
      return record.ok() ? findingOf(*record, search.limits, finding.check) : std::nullopt;
    };
    const auto fails = [&](const PassivityGesture& candidate) { return found(candidate).has_value(); };
    PassivityGesture small = shrunk(gesture, fails).gesture;
    const PassivityFinding of_small = found(small).value_or(finding);
    examples.push_back({std::string(source_name), model, seed, of_small, std::move(small)});
    return examples.size() < most;
  };
  ASSIGN_OR_RETURN([[maybe_unused]] const auto findings, searchGestures(search, model, source, keep));
  return examples;
}

}  // namespace needlelab::test
