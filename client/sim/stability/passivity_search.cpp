#include "client/sim/stability/passivity_search.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "client/sim/stability/passivity_gesture.h"
#include "common/base/range.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

void worsen(PassivityRecord& worst, const PassivityRecord& one) {
  worst.finite = worst.finite && one.finite;
  for (double PassivityRecord::*member :
       {&PassivityRecord::max_force_N, &PassivityRecord::net_J, &PassivityRecord::worst_insertion_J,
        &PassivityRecord::worst_running_J, &PassivityRecord::worst_step_N,
        &PassivityRecord::worst_torque_step_Nm})
    worst.*member = std::max(worst.*member, one.*member);
  worst.ticks += one.ticks;
  worst.insertions += one.insertions;
  worst.flags |= one.flags;
}

}  // namespace

LimbShape shapeOf(std::uint64_t seed) {
  return static_cast<LimbShape>(seed % kLimbShapeNames.size());
}

CounterExample smallestOf(const PassivityGesture& gesture, const PassivityFinding& finding,
                          const PassivityLimits& limits, AxialModel model, const ForceSourceFactory& source) {
  const auto found = [&](const PassivityGesture& candidate) -> std::optional<PassivityFinding> {
    const auto record = runGesture(candidate, model, source);
    return record.ok() ? findingOf(*record, limits, finding.check) : std::nullopt;
  };
  CounterExample example;
  example.model = model;
  example.gesture = shrunk(gesture, [&](const PassivityGesture& candidate) {
                      return found(candidate).has_value();
                    }).gesture;
  example.finding = found(example.gesture).value_or(finding);
  return example;
}

Result<PassivityFindings> searchGestures(const PassivitySearch& search, AxialModel model,
                                         const ForceSourceFactory& source) {
  PassivityFindings findings;
  findings.worst.net_J = -1e9;  // nets of gestures are negative as a rule
  const std::uint64_t stages_from = search.first_seed + search.gestures;
  for (std::uint64_t seed = search.first_seed; seed < stages_from + search.with_stages; ++seed) {
    GestureRange range = search.range;
    range.stages = range.stages || seed >= stages_from;
    PassivityGesture gesture = randomGesture(seed, shapeOf(seed), range);
    gesture.rate_hz = search.rate_hz;
    ASSIGN_OR_RETURN(const auto record, runGesture(gesture, model, source));
    ++findings.gestures;
    if (judgedEnergy_J(record) > judgedEnergy_J(findings.worst)) findings.energy_seed = seed;
    if (record.worst_step_N > findings.worst.worst_step_N) findings.step_seed = seed;
    worsen(findings.worst, record);
    const auto finding = findingOf(record, search.limits);
    if (!finding) continue;
    ++findings.failed;
    if (findings.counter_examples.size() >= search.most_counter_examples) continue;
    CounterExample example = smallestOf(gesture, *finding, search.limits, model, source);
    example.source = search.source_name;
    example.seed = seed;
    findings.counter_examples.push_back(std::move(example));
  }
  return findings;
}

namespace {

// a smaller gesture must also be possible for a hand: outside at both ends, …
bool beginsAndEndsOutside(const PassivityGesture& gesture) {
  constexpr double kOutside_m = -5e-4;
  return !gesture.strokes.empty() && gesture.start.depth_m <= kOutside_m &&
         gesture.strokes.back().depth_m <= kOutside_m;
}

// … and no faster than the original: strokes that are too fast get more time
void giveTime(PassivityGesture& gesture, double most_speed_mps, double most_turn_per_s) {
  const PassivityStroke* before = &gesture.start;
  for (PassivityStroke& stroke : gesture.strokes) {
    const double least_s = std::max(
        {0.02, wayBetween(*before, stroke) / most_speed_mps, turnBetween(*before, stroke) / most_turn_per_s});
    if (stroke.seconds < least_s) stroke.seconds = roundedTo(1.05 * least_s, 2);
    before = &stroke;
  }
}

// the stroke's current purpose, independent of the original one
StrokeKind kindOf(const PassivityStroke& stroke, const PassivityStroke& before) {
  if (stroke.depth_m < 0) return StrokeKind::kExit;
  if (stroke.depth_m > before.depth_m) return StrokeKind::kInsert;
  if (stroke.depth_m < before.depth_m) return StrokeKind::kRetreat;
  if (wayBetween(stroke, before) > 0) return StrokeKind::kAside;
  return turnBetween(stroke, before) > 0 ? StrokeKind::kTilt : StrokeKind::kHold;
}

class Shrinker {
 public:
  Shrinker(const PassivityGesture& gesture, const std::function<bool(const PassivityGesture&)>& fails,
           std::size_t most_tries)
      : fails_(fails), most_tries_(most_tries) {
    best_.gesture = gesture;
    size_ = sizeOf(gesture);
    const PassivityStroke* before = &gesture.start;
    for (const PassivityStroke& stroke : gesture.strokes) {
      most_speed_mps_ = std::max(most_speed_mps_, wayBetween(*before, stroke) / stroke.seconds);
      most_turn_per_s_ = std::max(most_turn_per_s_, turnBetween(*before, stroke) / stroke.seconds);
      before = &stroke;
    }
  }

  ShrinkResult run() {
    for (std::size_t taken_before = 0;; taken_before = best_.taken) {
      removeStrokes();
      removeEffects();
      removeLayers();
      simplify();
      zeroNumbers();
      roundNumbers();
      if (best_.taken == taken_before || best_.tried >= most_tries_) break;
    }
    const PassivityStroke* before = &best_.gesture.start;
    for (PassivityStroke& stroke : best_.gesture.strokes) {
      stroke.kind = kindOf(stroke, *before);
      before = &stroke;
    }
    return best_;
  }

 private:
  // keeps the candidate when it is smaller and still fails
  bool take(PassivityGesture candidate) {
    // a hundredth of a millimetre is the least that a reader can picture
    visitStrokes(candidate, [](double& value) { value = std::abs(value) < 1e-5 ? 0 : value; });
    giveTime(candidate, most_speed_mps_, most_turn_per_s_);
    const double size = sizeOf(candidate);
    if (!(size < size_) || best_.tried >= most_tries_ || !beginsAndEndsOutside(candidate)) return false;
    ++best_.tried;
    if (!fails_(candidate)) return false;
    ++best_.taken;
    best_.gesture = std::move(candidate);
    size_ = size;
    return true;
  }

  // halves, quarters, …, single strokes (Zeller and Hildebrandt's delta debugging, without its complements)
  void removeStrokes() {
    for (std::size_t length = std::max<std::size_t>(best_.gesture.strokes.size() / 2, 1);; length /= 2) {
      for (std::size_t from = 0; from < best_.gesture.strokes.size();) {
        PassivityGesture candidate = best_.gesture;
        const auto first = candidate.strokes.begin() + static_cast<std::ptrdiff_t>(from);
        const std::size_t count = std::min(length, candidate.strokes.size() - from);
        candidate.strokes.erase(first, first + static_cast<std::ptrdiff_t>(count));
        if (!take(candidate)) from += length;
      }
      if (length == 1) return;
    }
  }

  void removeEffects() {
    for (int i = best_.gesture.profile.effects_size() - 1; i >= 0; --i) {
      PassivityGesture candidate = best_.gesture;
      auto& effects = *candidate.profile.mutable_effects();
      effects.erase(effects.begin() + i);
      take(candidate);
    }
  }

  void removeLayers() {
    for (int i = best_.gesture.profile.layers_size() - 1; i >= 0; --i) {
      PassivityGesture candidate = best_.gesture;
      auto& layers = *candidate.profile.mutable_layers();
      if (layers.size() > 1) {
        layers.erase(layers.begin() + i);
        if (take(candidate)) continue;
      }
      candidate = best_.gesture;
      candidate.profile.mutable_layers(i)->clear_puncture();
      take(candidate);
    }
  }

  void simplify() {
    const auto tryWith = [&](const auto& change) {
      PassivityGesture candidate = best_.gesture;
      change(candidate);
      take(candidate);
    };
    tryWith([](PassivityGesture& g) {
      g.tremor_m = 0;
      g.tremor_seed = 1;
    });
    tryWith([](PassivityGesture& g) { g.encoder_step_m = 0; });
    tryWith([](PassivityGesture& g) {
      auto& plane = *g.profile.mutable_limb()->mutable_plane();
      plane.mutable_point_m()->set_x(0);
      plane.mutable_point_m()->set_y(0);
      plane.mutable_point_m()->set_z(0);
      plane.mutable_normal()->set_x(0);
      plane.mutable_normal()->set_y(0);
      plane.mutable_normal()->set_z(1);
    });
    tryWith([](PassivityGesture& g) {
      g.profile.mutable_tracking_wall()->set_stop_mode(pb::TrackingWall::RAMP);
    });
    // a stroke along fewer directions: as the one before it in one number
    for (std::size_t i = 0; i < best_.gesture.strokes.size(); ++i)
      for (double PassivityStroke::*member : {&PassivityStroke::x_m, &PassivityStroke::y_m,
                                              &PassivityStroke::tilt_x, &PassivityStroke::tilt_y}) {
        PassivityGesture candidate = best_.gesture;
        const PassivityStroke& before = i == 0 ? candidate.start : candidate.strokes[i - 1];
        candidate.strokes[i].*member = before.*member;
        take(candidate);
      }
  }

  // tries every number in turn: `change` gives the next value to try in its place, false when none is left
  template <typename Change>
  void eachNumber(void (*visitor)(PassivityGesture&, const NumberVisit&), const Change& change) {
    std::size_t count = 0;
    visitor(best_.gesture, [&](double&) { ++count; });
    for (std::size_t wanted = 0; wanted < count; ++wanted) {
      for (int attempt = 0;; ++attempt) {
        PassivityGesture candidate = best_.gesture;
        std::size_t at = 0;
        bool more = false;
        visitor(candidate, [&](double& value) {
          if (at++ == wanted) more = change(attempt, value);
        });
        if (!more || take(candidate)) break;
      }
    }
  }

  void zeroNumbers() {
    const auto zero = [](int attempt, double& value) {
      value = 0;
      return attempt == 0;
    };
    eachNumber(visitStrokes, zero);
    eachNumber(visitLayers, zero);
  }

  void roundNumbers() {
    // shorter, shallower, less aside: or the same number with fewer digits
    eachNumber(visitStrokes, [](int attempt, double& value) {
      static constexpr std::array<double, 6> kFactors = {0.5, 1, 1.5, 2, 0.75, 1};
      static constexpr std::array<int, 6> kDigits = {1, 1, 1, 1, 2, 2};
      if (attempt >= 6) return false;
      value = roundedTo(value * kFactors[static_cast<std::size_t>(attempt)],
                        kDigits[static_cast<std::size_t>(attempt)]);
      return true;
    });
    eachNumber(visitAll, [](int attempt, double& value) {
      value = roundedTo(value, attempt + 1);
      return attempt < 2;
    });
  }

  const std::function<bool(const PassivityGesture&)>& fails_;
  std::size_t most_tries_;
  ShrinkResult best_;
  double size_;
  double most_speed_mps_ = 1e-3, most_turn_per_s_ = 1e-3;  // mean, of a stroke of the gesture that came in
};

}  // namespace

ShrinkResult shrunk(const PassivityGesture& gesture,
                    const std::function<bool(const PassivityGesture&)>& fails, std::size_t most_tries) {
  return Shrinker(gesture, fails, most_tries).run();
}

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
    const auto* const known = std::find_if(kFields.begin(), kFields.end(),
                                           [&name = name](const Field& f) { return f.name == name; });
    if (known == kFields.end() || (is_start && name == "seconds")) return wrong(field, "is unknown");
    RETURN_IF_ERROR(readNumber(number, field, known->range, stroke.*known->member));
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
  RETURN_IF_ERROR(number("measured", example.finding.measured));
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

Result<CounterExample> parseCounterExample(std::string_view text, std::string_view source) {
  const std::string name(source);
  const json whole = json::parse(text, nullptr, false);
  if (whole.is_discarded()) return wrong(name, "is not JSON");
  if (!whole.is_object()) return wrong(name, "is not an object");
  for (const char* section : {"found", "motion", "profile"})
    if (!whole.contains(section) || !whole[section].is_object())
      return wrong(name + ": " + section, "is missing or no object");
  CounterExample example;
  RETURN_IF_ERROR(readFound(whole["found"], name + ": found", example));
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

}  // namespace needlelab
