#include <algorithm>
#include <cmath>
#include <utility>

#include "client/sim/stability/case_file.h"
#include "common/base/range.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

const nlohmann::json kNothing;

// "a.b" → a, b
std::pair<std::string, std::string> split(const std::string& path) {
  const auto dot = path.find('.');
  if (dot == std::string::npos) return {path, {}};
  return {path.substr(0, dot), path.substr(dot + 1)};
}

}  // namespace

CaseEntry::CaseEntry(const CaseFile& file, std::string_view case_name, bool long_form)
    : file_(&file), name_(case_name), long_form_(long_form) {
  const auto& cases = file.json().at("cases");
  if (const auto found = cases.find(name_); found != cases.end() && found->is_object())
    entry_ = *found;
  else
    status_ = Error{ErrorCode::kInvalidInput, file.source() + ": cases." + name_ + ": missing"};
}

void CaseEntry::fail(const std::string& field, const std::string& words) {
  if (status_.ok())
    status_ =
        Error{ErrorCode::kInvalidInput, file_->source() + ": cases." + name_ + "." + field + ": " + words};
}

const nlohmann::json* CaseEntry::find(const std::string& field) const {
  const nlohmann::json* at = &entry_;
  for (std::string rest = field; !rest.empty();) {
    const auto [head, tail] = split(rest);
    if (!at->is_object()) return nullptr;
    const auto found = at->find(head);
    if (found == at->end()) return nullptr;
    at = &*found;
    rest = tail;
  }
  return at;
}

const nlohmann::json& CaseEntry::need(const std::string& field) {
  if (const auto* found = find(field)) return *found;
  fail(field, "missing");
  return kNothing;
}

bool CaseEntry::has(const std::string& field) const {
  return find(field) != nullptr;
}

double CaseEntry::number(const std::string& field, double least, double most) {
  const nlohmann::json& value = need(field);
  const NumberRange range{least, most};
  if (value.is_number() && range.contains(value.get<double>())) return value.get<double>();
  if (value.is_number())
    fail(field, numberText(value.get<double>()) + " is out of range " + rangeText(range));
  else
    fail(field, "must be a number");
  return std::clamp(1.0, least, most);
}

std::vector<double> CaseEntry::numbers(const std::string& field) {
  const nlohmann::json& list = need(field);
  std::vector<double> out;
  if (list.is_array())
    for (const auto& value : list)
      if (value.is_number()) out.push_back(value.get<double>());
  if (out.empty() || out.size() != list.size()) {
    fail(field, "must be a list of numbers");
    return {1};
  }
  return out;
}

std::uint64_t CaseEntry::whole(const std::string& field, std::uint64_t least) {
  const std::string at =
      find(field) != nullptr && find(field)->is_object() ? field + (long_form_ ? ".long" : ".short") : field;
  const double value = number(at, static_cast<double>(least), 1e9);
  if (value != std::floor(value)) fail(at, "must be a whole number");
  return static_cast<std::uint64_t>(value);
}

std::string CaseEntry::text(const std::string& field) {
  const nlohmann::json& value = need(field);
  if (value.is_string()) return value.get<std::string>();
  fail(field, "must be a text");
  return {};
}

double CaseEntry::between(const std::string& field, double s) {
  const double low = number(field + ".low"), high = number(field + ".high");
  return low + (high - low) * s;
}

SceneSpec CaseEntry::scene() {
  const std::string name = text("scene");
  const auto& scenes = file_->json().at("scenes");
  if (!scenes.contains(name)) {
    fail("scene", "there is no scene '" + name + "' in this file");
    return {};
  }
  nlohmann::json profile = scenes.at(name);
  if (const auto* patch = find("scene_patch")) profile.merge_patch(*patch);
  const auto parsed = parseProfile(profile.dump(), file_->source() + ": cases." + name_ + ": scene " + name);
  if (!parsed.ok()) {
    if (status_.ok()) status_ = parsed.error();
    return {};
  }
  auto spec = sceneSpecOf(*parsed);
  if (!spec.ok()) {
    if (status_.ok()) status_ = spec.error();
    return {};
  }
  return *std::move(spec);
}

SceneSpec CaseEntry::scene(AxialModel model) {
  const SceneSpec spec = scene();
  return status_.ok() ? likeForLike(spec, model) : spec;
}

PlantOptions CaseEntry::plant() {
  // the case's own numbers stand above the file's
  nlohmann::json merged = file_->json().at("plant");
  if (const auto* own = find("plant")) merged.merge_patch(*own);
  PlantOptions options;
  SimulatedDeviceOptions& device = options.device;
  double delay = 1, seed = 1;
  struct Row {
    const char* field;
    double* value;
  };
  const Row rows[] = {
      {"rate_hz", &options.rate_hz},
      {"jitter_share", &options.jitter_share},
      {"missing_share", &options.missing_share},
      {"mass_kg", &device.limits.apparent_mass_kg},
      {"damping_ns_per_m", &device.limits.damping_Ns_per_m},
      {"dry_friction_n", &device.dry_friction_N},
      {"encoder_step_m", &device.encoder_step_m},
      {"integration_hz", &device.integration_hz},
      {"hand_stiffness_n_per_m", &device.hand.stiffness_N_per_m},
      {"hand_damping_ns_per_m", &device.hand.damping_Ns_per_m},
      {"tremor_m", &device.hand.tremor_m},
      {"delay_ticks", &delay},
      {"seed", &seed},
  };
  for (const auto& item : merged.items()) {
    // no structured binding: clang 14 takes none into a lambda
    const std::string& key = item.key();
    const nlohmann::json& value = item.value();
    const auto* row =
        std::find_if(std::begin(rows), std::end(rows), [&](const Row& r) { return key == r.field; });
    if (row == std::end(rows) || !value.is_number())
      fail("plant." + key, row == std::end(rows) ? "unknown" : "must be a number");
    else
      *row->value = value.get<double>();
  }
  // whole numbers; the others' ranges are the device's business
  if (!(delay >= 0 && delay <= SimulatedDevice::kMaxDelayTicks && delay == std::floor(delay)))
    fail("plant.delay_ticks", "must be a whole number, 0 to 15");
  else
    device.delay_ticks = static_cast<std::uint32_t>(delay);
  if (!(seed >= 0 && seed <= 1e9 && seed == std::floor(seed)))
    fail("plant.seed", "must be a whole number, 0 to 1e9");
  else
    options.seed = device.hand.seed = static_cast<std::uint64_t>(seed);
  return options;
}

TimedPlan CaseEntry::path(const std::string& field, const PathChange& change) {
  const Quat down = orientationAlong({0, 0, -1});
  TimedPlan timed;
  const nlohmann::json& list = need(field);
  if (!list.is_array() || list.size() < 2 || !list.front().is_object() ||
      !list.front().contains("from_depth_m")) {
    fail(field, "must be a list whose first element has from_depth_m");
    return timed;
  }
  const auto value = [&](const nlohmann::json& step, const char* key, double least, double most) {
    const auto found = step.find(key);
    const NumberRange range{least, most};
    if (found != step.end() && found->is_number() && range.contains(found->get<double>()))
      return found->get<double>();
    fail(field, std::string(key) + " must be a number within " + rangeText(range));
    return std::max(least, 0.01);
  };
  timed.plan = HandPlan({{0, 0, -value(list.front(), "from_depth_m", -1, 1)}, down});
  for (std::size_t i = 1; i < list.size() && status_.ok(); ++i) {
    const nlohmann::json& step = list[i];
    if (!step.is_object() || step.contains("hold_s") == step.contains("to_depth_m")) {
      fail(field, "each step has either hold_s or to_depth_m");
      break;
    }
    const double from_s = timed.plan.duration_s();
    if (step.contains("hold_s")) {
      timed.plan.hold(value(step, "hold_s", 1e-3, 600));
    } else {
      const std::string motion = step.value("motion", "LINEAR");
      const Motion kind = motion == "TRAPEZOID"  ? Motion::kTrapezoid
                          : motion == "MIN_JERK" ? Motion::kMinJerk
                                                 : Motion::kLinear;
      if (kind == Motion::kLinear && motion != "LINEAR")
        fail(field, "motion must be LINEAR, TRAPEZOID or MIN_JERK");
      const double depth = value(step, "to_depth_m", -1, 1);
      const bool faster = change.speed_step.empty() || change.speed_step == step.value("name", "");
      timed.plan.moveTo({{0, 0, -(depth > 0 ? depth + change.depth_offset_m : depth)}, down},
                        value(step, "speed_m_s", 1e-5, 5) * (faster ? change.speed_factor : 1), kind);
    }
    timed.steps.push_back({step.value("name", ""), from_s, timed.plan.duration_s()});
  }
  return timed;
}

TimeWindow CaseEntry::window(const TimedPlan& plan, const std::string& field) {
  const std::string step = text(field + ".step");
  const auto found = std::find_if(plan.steps.begin(), plan.steps.end(),
                                  [&](const TimedPlan::Step& one) { return one.name == step; });
  if (found == plan.steps.end()) {
    fail(field + ".step", "the path has no step '" + step + "'");
    return {};
  }
  const double length = found->to_s - found->from_s;
  const double from = number(field + ".from_s", 0, length);
  const double to = has(field + ".to_s") ? number(field + ".to_s", from, length) : length;
  return {found->from_s + from, found->from_s + to};
}

BandFilter CaseEntry::chatterFilter() {
  BandFilter band;
  const auto& filters = file_->json().at("filters");
  const auto read = [&](const char* key, double& value, const NumberRange& range) {
    const auto found =
        filters.contains("chatter") ? filters["chatter"].value(key, nlohmann::json()) : kNothing;
    if (found.is_number() && range.contains(found.get<double>()))
      value = found.get<double>();
    else if (status_.ok())
      status_ = Error{ErrorCode::kInvalidInput, file_->source() + ": filters.chatter." + key +
                                                    ": must be a number within " + rangeText(range)};
  };
  double order = band.order;
  read("low_hz", band.low_hz, {0, 1e5, true});
  read("high_hz", band.high_hz, {0, 1e5, true});
  read("order", order, {2, 8});
  band.order = static_cast<int>(order / 2) * 2;
  return band;
}

}  // namespace needlelab
