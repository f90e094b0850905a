// Measures of the needle in tissue: depth and forces, targets and hazards, the plan, the syringe.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/haptics/engine.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"
#include "common/profile/layer_names.h"
#include "common/scoring/bone_contacts.h"
#include "common/scoring/measure_groups.h"
#include "common/scoring/measure_table.h"
#include "common/scoring/syringe_events.h"

namespace needlelab {
namespace {

/// Turns closer together than this are one change of trajectory: the limit on turning speed lets the engine
/// pause between them.
constexpr double kTurnPause_s = 0.2;
/// Shorter insertions have no straight path for comparison.
constexpr double kLeastWay_m = 1e-3;
/// An insertion ends within this distance of its greatest length: at rest, tremor may reach the greatest
/// length at any time.
constexpr double kEndWithin_m = 0.25e-3;

/// For this time after a change of layer, the force counts for neither layer: the drop behind a boundary
/// takes some ticks, and their number depends on the loop's rate.
constexpr double kLayerChange_s = 0.01;

double forceOf(const GestureSample& s) {
  return norm({s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]});
}
Vec3 tipOf(const GestureSample& s) {
  return {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]};
}

/// Entries, withdrawals and turns of a gesture.
struct Counts {
  int entries = 0, withdrawals = 0, turns = 0;
};

Counts countEvents(const Gesture& gesture) {
  Counts counts;
  bool was_inside = false, was_withdrawing = false;
  std::size_t last_turn = 0;
  bool any_turn = false;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    const GestureSample& sample = gesture.samples[i];
    const bool inside = isInside(sample);
    // the flag reveals an entry after an exit that was lost in missing ticks
    const bool entered = inside && (!was_inside || (sample.flags & kFlagEntry) != 0);
    if (entered) {
      ++counts.entries;
      was_withdrawing = false;
    }
    if (inside && sample.phase == static_cast<std::uint8_t>(Phase::kWithdrawing)) {
      if (!was_withdrawing) ++counts.withdrawals;
      was_withdrawing = true;
    } else if (inside && sample.phase == static_cast<std::uint8_t>(Phase::kInserting)) {
      was_withdrawing = false;
    }
    if ((sample.flags & kFlagTurn) != 0) {
      const bool goes_on =
          any_turn && secondsBetween(gesture.samples[last_turn], sample, gesture.rate_hz) <= kTurnPause_s;
      if (!goes_on) ++counts.turns;
      last_turn = i;
      any_turn = true;
    }
    was_inside = inside;
  }
  return counts;
}

/// The path length in tissue up to the end of the longest insertion, divided by the straight line from its
/// entry to that end. Paths before that entry (of abandoned insertions) count, too. The insertion ends where
/// it first comes within kEndWithin_m of its greatest length. 0 without an insertion.
double inefficiencyOf(const Gesture& gesture) {
  std::size_t deepest = 0, entry = 0, deepest_entry = 0;
  double greatest_m = 0;
  bool was_inside = false;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    const bool inside = isInside(gesture.samples[i]);
    if (inside && (!was_inside || (gesture.samples[i].flags & kFlagEntry) != 0)) entry = i;
    if (inside && gesture.samples[i].insertion_m > greatest_m) {
      greatest_m = gesture.samples[i].insertion_m;
      deepest = i;
      deepest_entry = entry;
    }
    was_inside = inside;
  }
  if (gesture.samples.empty()) return 0;
  const auto& samples = gesture.samples;
  std::size_t end = deepest_entry;
  while (end < deepest && samples[end].insertion_m < greatest_m - kEndWithin_m) ++end;
  const double straight_m = norm(tipOf(samples[end]) - tipOf(samples[deepest_entry]));
  if (straight_m < kLeastWay_m) return 0;

  const double end_s = secondsBetween(samples.front(), samples[end], gesture.rate_hz);
  double way_m = 0;
  for (const Run& run : gesture.runs) {
    for (std::size_t i = 0; i < run.inside.size(); ++i) {
      // the last step counts in part
      const double from_s = run.start_s + static_cast<double>(i) * run.period_s;
      const double share = std::clamp((end_s - from_s) / run.period_s, 0.0, 1.0);
      way_m += share * run.inside[i] * norm(run.points[i + 1].p_WT_m - run.points[i].p_WT_m);
    }
  }
  return std::max(1.0, way_m / straight_m);
}

Vec3 axisOf(const GestureSample& s) {
  return zAxis(normalized(Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]}));
}

/// The shaft's point at the skin: back from the tip by the inserted length, along the needle.
Vec3 skinPointOf(const GestureSample& s) {
  return tipOf(s) - s.insertion_m * axisOf(s);
}

/// The point where the tip first came through the skin, as the engine has it (FORCE_MODEL.md, "Contact"): on
/// the straight line between the last tick outside and the first one inside, where the depth is 0. If nobody
/// saw the tick before, back along the needle by its inserted length. Nothing: never in tissue.
std::optional<Vec3> firstEntryOf(const Gesture& gesture) {
  const auto& samples = gesture.samples;
  std::size_t first = 0;
  while (first < samples.size() && !isInside(samples[first])) ++first;
  if (first == samples.size()) return std::nullopt;
  if (first > 0 && gesture.anatomy.has_limb &&
      secondsBetween(samples[first - 1], samples[first], gesture.rate_hz) <= kLongestBridge_s) {
    const Vec3 before = tipOf(samples[first - 1]), tip = tipOf(samples[first]);
    const double outside_m = -signedDepth(gesture.anatomy.limb, before),
                 inside_m = signedDepth(gesture.anatomy.limb, tip);
    if (outside_m >= 0 && inside_m > 0) return before + outside_m / (outside_m + inside_m) * (tip - before);
  }
  return skinPointOf(samples[first]);
}

/// Distance of the tip from the nearest target's centre, and whether it is in that target.
struct Aim {
  double distance_m = std::numeric_limits<double>::infinity();
  bool reached = false;
};

Aim aimOf(const Anatomy& anatomy, Vec3 tip_W_m) {
  Aim aim;
  for (const Region& target : anatomy.targets) {
    const double distance_m = norm(tip_W_m - target.a_W_m);
    aim.distance_m = std::min(aim.distance_m, distance_m);
    aim.reached = aim.reached || distance_m <= target.radius_m;
  }
  return aim;
}

/// Finds the furthest point of the last insertion: the needle's place before it was drawn out. False: never
/// in tissue.
bool finalPoint(const Gesture& gesture, std::size_t& index) {
  bool found = false, was_inside = false;
  double furthest_m = 0;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    const GestureSample& sample = gesture.samples[i];
    const bool inside = isInside(sample);
    if (inside && (!was_inside || sample.insertion_m >= furthest_m)) {
      index = i;
      furthest_m = sample.insertion_m;
      found = true;
    }
    was_inside = inside;
  }
  return found;
}

void addTargets(const Gesture& gesture, Rows& rows) {
  double nearest_m = std::numeric_limits<double>::infinity(), time_s = 0;
  bool reached = false;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    if (!isInside(gesture.samples[i])) continue;
    const Aim aim = aimOf(gesture.anatomy, tipOf(gesture.samples[i]));
    nearest_m = std::min(nearest_m, aim.distance_m);
    if (!aim.reached) continue;
    reached = true;
    time_s += gesture.weight_s(i);
  }
  rows.add("target_reached", reached ? 1 : 0);
  rows.add("time_at_target_s", time_s);
  std::size_t last = 0;
  if (!finalPoint(gesture, last)) return;
  rows.add("target_distance_m", aimOf(gesture.anatomy, tipOf(gesture.samples[last])).distance_m);
  rows.add("target_nearest_m", nearest_m);
}

}  // namespace

double Gesture::weight_s(std::size_t i) const {
  const auto half = [&](std::size_t a, std::size_t b) {
    const double gap_s = secondsBetween(samples[a], samples[b], rate_hz);
    return gap_s <= kLongestBridge_s ? 0.5 * gap_s : 0.0;
  };
  return (i > 0 ? half(i - 1, i) : 0) + (i + 1 < samples.size() ? half(i, i + 1) : 0);
}

/// - `greatest_depth_m`: of the tip under the surface, along its normal. `greatest_insertion_m`: along the
///   trajectory.
/// - `peak_force_n`: greatest force on the hand, of all ticks. `peak_force_layer_K_n`: while the tip was in
///   layer K (1 is the skin), 0 if it never was. `mean_force_in_tissue_n`: mean over the time in tissue.
///   `mean_force_layer_K_n`: mean over the time in layer K; no row if there was none.
/// - `largest_lateral_error_m`: distance of the tip from its own trajectory, the line that its entry began.
/// - `entries`: number of times the tip went in. `withdrawals`: number of times it was drawn back (a stop on
///   the way does not begin another). `trajectory_changes`: runs of turns, pauses up to 0.2 s included.
/// - `path_inefficiency`: path in tissue over the straight line to within 0.25 mm of the furthest point; 1 is
///   straight.
void addTissue(const Gesture& gesture, Rows& rows) {
  double depth_m = 0, insertion_m = 0, lateral_m = 0, peak_N = 0, impulse_Ns = 0, time_s = 0;
  std::vector<double> layer_peaks(static_cast<std::size_t>(gesture.profile->layers_size()), 0.0);
  std::vector<double> layer_impulses(layer_peaks), layer_times(layer_peaks);
  int layer_before = -1;
  GestureSample changed;  // at the tip's last change of layer
  bool has_changed = false;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    const GestureSample& sample = gesture.samples[i];
    const double force_N = forceOf(sample);
    peak_N = std::max(peak_N, force_N);
    if (sample.layer != layer_before) {
      changed = sample;
      has_changed = layer_before >= 0 && isInside(sample);
    }
    layer_before = sample.layer;
    if (!isInside(sample)) continue;
    if (gesture.anatomy.has_limb)
      depth_m = std::max(depth_m, signedDepth(gesture.anatomy.limb, tipOf(sample)));
    insertion_m = std::max(insertion_m, sample.insertion_m);
    lateral_m = std::max(lateral_m, sample.lateral_error_m);
    const double weight_s = gesture.weight_s(i);
    impulse_Ns += force_N * weight_s;
    time_s += weight_s;
    const auto layer =
        static_cast<std::size_t>(static_cast<unsigned char>(sample.layer));  // not negative here
    const bool changing =
        has_changed && secondsBetween(changed, sample, gesture.rate_hz) < kLayerChange_s * (1 - 1e-9);
    if (layer >= layer_peaks.size() || changing) continue;
    layer_peaks[layer] = std::max(layer_peaks[layer], force_N);
    layer_impulses[layer] += force_N * weight_s;
    layer_times[layer] += weight_s;
  }
  rows.add("greatest_depth_m", depth_m);
  rows.add("greatest_insertion_m", insertion_m);
  rows.add("peak_force_n", peak_N);
  rows.add("mean_force_in_tissue_n", time_s > 0 ? impulse_Ns / time_s : 0);
  const std::vector<std::string> names = layerNames(*gesture.profile);
  const auto addOfLayer = [&](std::string name, double value) {
    std::string words = measureWords(name, names);
    rows.add(std::move(name), value, std::move(words));
  };
  for (std::size_t i = 0; i < layer_peaks.size(); ++i)
    addOfLayer(fmt::format("peak_force_layer_{}_n", i + 1), layer_peaks[i]);
  for (std::size_t i = 0; i < layer_peaks.size(); ++i) {
    if (layer_times[i] > 0)
      addOfLayer(fmt::format("mean_force_layer_{}_n", i + 1), layer_impulses[i] / layer_times[i]);
  }
  rows.add("largest_lateral_error_m", lateral_m);
  const Counts counts = countEvents(gesture);
  rows.add("entries", counts.entries);
  rows.add("withdrawals", counts.withdrawals);
  rows.add("trajectory_changes", counts.turns);
  const double inefficiency = inefficiencyOf(gesture);
  if (inefficiency > 0) rows.add("path_inefficiency", inefficiency);
}

/// Counted while the tip is in tissue.
/// - `target_reached` (1 or 0): the tip was within a target's radius of its centre. `time_at_target_s`: the
///   total time there.
/// - `target_distance_m`: distance of the tip from the nearest target's centre at the furthest point of the
///   last insertion; `target_nearest_m`: the least distance at any time.
/// - `hazards_touched`: number of hazards touched by the tip or by the shaft in tissue (straight back along
///   the needle). `bone_contacts`: times that the tip came into bone (bone_contacts.h).
void addAim(const Gesture& gesture, Rows& rows) {
  const std::vector<Region>& hazards = gesture.anatomy.hazards;
  std::vector<bool> touched(hazards.size(), false);
  BoneContacts bones(*gesture.profile, gesture.anatomy);
  int bone_contacts = 0;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    const GestureSample& sample = gesture.samples[i];
    const Vec3 tip = tipOf(sample);
    if (bones.add(secondsBetween(gesture.samples.front(), sample, gesture.rate_hz), sample.layer, tip))
      ++bone_contacts;
    if (!isInside(sample)) continue;
    const Vec3 skin = skinPointOf(sample);
    for (std::size_t h = 0; h < hazards.size(); ++h) {
      if (!touched[h] && distanceTo(hazards[h], tip, skin) <= 0) touched[h] = true;
    }
  }
  std::string names;
  for (std::size_t h = 0; h < hazards.size(); ++h) {
    if (touched[h]) names += (names.empty() ? " (" : ", ") + hazards[h].name;
  }
  rows.add("hazards_touched", static_cast<double>(std::count(touched.begin(), touched.end(), true)),
           "Hazards touched" + (names.empty() ? names : names + ")"));
  rows.add("bone_contacts", bone_contacts);
  if (!gesture.anatomy.targets.empty()) addTargets(gesture, rows);
}

/// With the planned entry E and the planned direction d (unit, into the tissue), both in W; no rows without a
/// plan, nor for a needle that was never in tissue.
/// - `planned_entry_error_m`: |P − E|, P the point where the tip first came through the skin. The straight
///   distance: on a limb of radius R it is shorter than the way along the skin by less than 0.2 % up to R/5.
/// - `planned_angle_error_rad`: atan2(|a × d|, a · d), a the needle's axis (hub to tip) at the furthest
///   point of the last insertion, the moment of `target_distance_m`. 0 along the plan, π for a needle that
///   points back.
/// - `mean_planned_line_error_m`: Σ w |r − (r·d) d| / Σ w over the ticks in tissue, r = tip − E and w a
///   tick's time; no row where that time is 0. `largest_planned_line_error_m`: the greatest |r − (r·d) d|
///   in tissue. The line has no ends.
void addPlan(const Gesture& gesture, Rows& rows) {
  std::size_t last = 0;
  const auto entry = gesture.plan_W ? firstEntryOf(gesture) : std::nullopt;
  if (!entry || !finalPoint(gesture, last)) return;
  const PlannedLine& plan = *gesture.plan_W;
  rows.add("planned_entry_error_m", norm(*entry - plan.entry_m));
  rows.add("planned_angle_error_rad", angleTo(plan, axisOf(gesture.samples[last])));
  double sum_ms = 0, time_s = 0, largest_m = 0;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    if (!isInside(gesture.samples[i])) continue;
    const double off_m = distanceFrom(plan, tipOf(gesture.samples[i]));
    const double weight_s = gesture.weight_s(i);
    largest_m = std::max(largest_m, off_m);
    sum_ms += off_m * weight_s;
    time_s += weight_s;
  }
  if (time_s > 0) rows.add("mean_planned_line_error_m", sum_ms / time_s);
  rows.add("largest_planned_line_error_m", largest_m);
}

/// - `aspirations`, `injections`: strokes of the plunger (syringe_events.h). `injected_share`: share of the
///   syringe that was pressed out by all injections together, in or outside tissue; above 1 when it was drawn
///   up and pressed again.
/// - `injected_in_target_share`: the part of that which left the needle's opening in a target; only if
///   something was injected and the profile has a target.
/// - `aspirated_before_injection` (1 or 0): an aspiration that began in tissue came before the
///   first injection with a part in tissue; only if there was such an injection.
void addSyringe(const Gesture& gesture, std::span<const pb::SyringeEvent> events, Rows& rows) {
  int aspirations = 0, injections = 0;
  double injected = 0, in_target = 0;
  bool aspirated = false, injected_in_tissue = false, was_aspirated = false;
  for (const pb::SyringeEvent& event : events) {
    if (event.kind() == pb::SyringeEvent::ASPIRATION) {
      ++aspirations;
      aspirated = aspirated || event.begin().in_tissue();
      continue;
    }
    ++injections;
    const double stroke = event.plunger_to() - event.plunger_from();
    injected += stroke;
    in_target += stroke * event.in_target_share();
    if (!injected_in_tissue && event.in_tissue_share() > 0) {
      injected_in_tissue = true;
      was_aspirated = aspirated;
    }
  }
  rows.add("aspirations", aspirations);
  rows.add("injections", injections);
  rows.add("injected_share", injected);
  if (injections > 0 && !gesture.anatomy.targets.empty())
    rows.add("injected_in_target_share", injected > 0 ? std::min(1.0, in_target / injected) : 0);
  if (injected_in_tissue) rows.add("aspirated_before_injection", was_aspirated ? 1 : 0);
}

}  // namespace needlelab
