#include "common/scoring/alarms/alarms.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>

#include "common/profile/structure_kinds.h"
#include "common/scoring/anatomy/contacts.h"
#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

constexpr double kSkinGives_m = 5e-3;

constexpr std::array<AlarmKind, 7> kAlarmKinds = {{
    {Alarm::kFault, "fault", "NO FORCE", false, true},
    {Alarm::kHazard, "hazard", "HAZARD", true, true},
    {Alarm::kBone, "bone", "BONE", true, true},
    {Alarm::kForce, "force", "TOO MUCH FORCE", true, false},
    {Alarm::kDepth, "depth", "TOO DEEP", true, false},
    {Alarm::kDevice, "device", "DEVICE", false, false},
    {Alarm::kTime, "time", "TIME", false, false},
}};

std::optional<double> limitOf(const pb::Exercise* exercise, MeasureRole role) {
  if (exercise == nullptr) return std::nullopt;
  for (const auto& requirement : exercise->requirements())
    if (roleOf(requirement.measure()) == role && requirement.has_max()) return requirement.max();
  return std::nullopt;
}

double lowestTarget_m(const Anatomy& anatomy) {
  double lowest_m = -std::numeric_limits<double>::infinity();
  for (const Target& target : anatomy.targets)
    lowest_m = std::max(lowest_m, depthSpanOf(anatomy, target).bottom_m);
  return lowest_m;
}

}  // namespace

std::span<const AlarmKind> alarmKinds() {
  return kAlarmKinds;
}

const AlarmKind& kindOf(Alarm alarm) {
  return kAlarmKinds[static_cast<std::size_t>(alarm)];
}

AlarmLimits alarmLimitsOf(const Anatomy& anatomy, const pb::Exercise* exercise) {
  const double usual_m =
      anatomy.targets.empty() ? AlarmLimits{}.depth_m : lowestTarget_m(anatomy) + kTooDeep_m;
  return {limitOf(exercise, MeasureRole::kForce).value_or(kUsualForceLimit_N),
          limitOf(exercise, MeasureRole::kDepth).value_or(usual_m)};
}

GestureAlarms::GestureAlarms(const pb::Profile& profile, const Anatomy& anatomy, const AlarmLimits& limits)
    : anatomy_(anatomy), bones_(profile, anatomy), limits_(limits) {
  for (std::size_t h = 0; h < anatomy.hazards.size(); ++h) {
    if (hazardKindOf(profile, profile.hazards(static_cast<int>(h))) == pb::Hazard::BONE) continue;  // kBone
    hazards_.push_back(anatomy.hazards[h]);
    states_.push_back({Alarm::kHazard, anatomy.hazards[h].name});
  }
  states_.push_back({Alarm::kBone, "bone contact"});
  states_.push_back({Alarm::kForce, ""});
  states_.push_back({Alarm::kDepth, ""});
  states_.push_back({Alarm::kDepth, std::string(kHubContactWords)});
}

void GestureAlarms::restart() {
  for (State& state : states_) state.until_s.reset(), state.begun = 0;
  time_s_ = 0;
}

void GestureAlarms::check(std::size_t index, bool on, double worst) {
  State& state = states_[index];
  if (!on) return;
  const bool lasts = state.until_s && time_s_ <= *state.until_s;
  state.worst = lasts ? std::max(state.worst, worst) : worst;
  state.until_s = time_s_ + kAlarmLasts_s;
  if (lasts) return;
  ++state.begun;
  begun_.push_back({state.alarm, detailOf(state)});
}

std::span<const ActiveAlarm> GestureAlarms::add(const AlarmTick& tick) {
  if (states_.empty()) return {};
  if (tick.time_s < time_s_) restart();
  time_s_ = tick.time_s;
  begun_.clear();
  const std::size_t hazards = hazards_.size();
  if (tick.inside) {
    for (std::size_t h = 0; h < hazards; ++h)
      check(h, distanceTo(hazards_[h], tick.tip_W_m, tick.skin_W_m) <= 0);
    check(hazards, bones_.isIn(tick.layer, tick.tip_W_m));
    // a tip is no deeper than its shaft in the tissue is long, but for the way that the skin gave
    const bool is_far_in = norm(tick.tip_W_m - tick.skin_W_m) + kSkinGives_m > limits_.depth_m;
    const double depth_m = is_far_in ? depthAt(anatomy_, tick.tip_W_m) : 0;
    check(hazards + 2, depth_m > limits_.depth_m, depth_m);
    check(hazards + 3, tick.hub_on_skin);
  }
  check(hazards + 1, tick.force_N > limits_.force_N, tick.force_N);
  return begun_;
}

std::string GestureAlarms::detailOf(const State& state) const {
  if (!state.name.empty()) return state.name;
  return state.alarm == Alarm::kForce
             ? fmt::format("{:.1f} N, allowed {:.3g} N", state.worst, limits_.force_N)
             : fmt::format("{:.1f} mm, allowed {:.3g} mm", 1e3 * state.worst, 1e3 * limits_.depth_m);
}

std::vector<ActiveAlarm> GestureAlarms::now() const {
  std::vector<ActiveAlarm> alarms;
  for (const State& state : states_)
    if (state.until_s && time_s_ <= *state.until_s) alarms.push_back({state.alarm, detailOf(state)});
  return alarms;
}

std::vector<AlarmCount> GestureAlarms::counts() const {
  std::vector<AlarmCount> counts;
  for (const State& state : states_) {
    if (state.begun == 0) continue;
    if (counts.empty() || counts.back().alarm != state.alarm) counts.push_back({state.alarm, 0, false, ""});
    AlarmCount& count = counts.back();
    const bool now = state.until_s && time_s_ <= *state.until_s;
    count.begun += state.begun;
    if (count.detail.empty() || (now && !count.now)) count.detail = detailOf(state);
    count.now = count.now || now;
  }
  return counts;
}

}  // namespace needlelab
