/// Energy that a hand may receive: random gestures in random scenes, prescribed and with a hand; the
/// passivity control before the gate, compared with the same loop without it; and devices that render late or
/// imprecisely, with the control that a station enables by itself where passivity is not proven
/// (client/station/run/lesson/lesson.h), given its measured delay and lag.

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

// The gate fades the force in over the first 200 ms (§3.7). A spring pressed during that time returns more
// than it took, so gestures start after the fade-in.
HandPlan restedPlan(PassivityGesture gesture) {
  PassivityStroke rest = gesture.start;
  rest.seconds = 0.25;
  gesture.strokes.insert(gesture.strokes.begin(), rest);
  return planOf(gesture);
}

// The entry `random_energy`, which supplies gestures and hands for the other cases.
struct Gestures {
  Trial of;
  GestureSearch search;
  std::vector<double> hands_N_per_m, hands_Ns_per_m;  // stiff, normal or nearly free

  explicit Gestures(const Trial& t) : of(t.settings, "random_energy", t.model, t.source) {
    search.gestures = ofModel(of, "gestures");
    search.with_stages = ofModel(of, "with_stages", 0);
    search.first_seed = of.whole("first_seed");
    hands_N_per_m = of.numbers("hands_n_per_m");
    hands_Ns_per_m = of.numbers("hands_ns_per_m");
  }
  // fewer for the other models, because FEM builds a mesh for each
  static std::uint64_t ofModel(Trial& t, const std::string& field, std::uint64_t least = 1) {
    return t.whole(t.model == AxialModel::kEnhancedTrackingWall ? field : field + "_of_other_models", least);
  }

  // Returns a seed's gesture; puts the seed's hand into the plant and its scene into the trial.
  Result<PassivityGesture> take(std::uint64_t seed) {
    RETURN_IF_ERROR(of.status());
    PassivityGesture gesture = randomGesture(seed, search.range);
    ASSIGN_OR_RETURN(const auto given, sceneSpecOf(gesture.profile));
    of.scene = likeForLike(given, of.model);
    HandOptions& hand = of.plant.device.hand;
    const std::size_t grip = seed % std::min(hands_N_per_m.size(), hands_Ns_per_m.size());
    hand.stiffness_N_per_m = hands_N_per_m[grip];
    hand.damping_Ns_per_m = hands_Ns_per_m[grip];
    hand.tremor_m = gesture.tremor_m;
    hand.seed = gesture.tremor_seed;
    return gesture;
  }
};

struct WithHand {
  double grip_J = -1e9;
  double observed_step_N = 0;  ///< by the passivity observer
  CaseRow row;
};

// Runs gestures from `first_seed` on, with scenes reduced to what a station renders with the plant's tool.
Result<WithHand> withHands(Gestures& g, std::uint64_t first_seed, std::uint64_t gestures) {
  WithHand worst;
  worst.row.finite = true;
  const PlantOptions& plant = g.of.plant;
  for (std::uint64_t seed = first_seed; seed < first_seed + gestures; ++seed) {
    ASSIGN_OR_RETURN(const auto gesture, g.take(seed));
    if (!(plant.device.X_HT == Pose{})) {
      ASSIGN_OR_RETURN(const auto source, g.of.source(g.of.scene, plant.rate_hz));
      lowerStiffness(g.of.scene, {.lever = heldStiffnessShare(g.of.scene, source->axialStiffness_N_per_m(),
                                                              plant.device.limits, plant.device.X_HT)});
    }
    ASSIGN_OR_RETURN(const auto run, g.of.loop(restedPlan(gesture)));
    worst.grip_J = std::max(worst.grip_J, run.ticks.back().grip_J);
    PassivityObserver observer(run.axial_stiffness_N_per_m);
    for (const PlantTick& tick : run.ticks)
      if (tick.stepped) observer.add(tick.seen, tick.report, tick.slant);
    worst.observed_step_N = std::max(worst.observed_step_N, observer.record().worst_step_N);
    worsen(worst.row, measuredRow(run, {}));
  }
  return worst;
}

Status randomEnergy(Trial& t) {
  Gestures g(t);
  const PassivityLimits& limits = g.search.limits;
  const std::uint64_t with_hand = Gestures::ofModel(g.of, "with_hand", 0);
  RETURN_IF_ERROR(g.of.status());
  ASSIGN_OR_RETURN(const auto found, searchGestures(g.search, t.model, t.source));
  ASSIGN_OR_RETURN(const auto held, withHands(g, g.search.first_seed, with_hand));
  CaseRow& row = t.row();
  worsen(row, rowOf(found.worst));
  row.finite = row.finite && held.row.finite;
  row.max_force_N = std::max(*row.max_force_N, held.row.max_force_N.value_or(0));
  row.max_unexplained_step_N = std::max(*row.max_unexplained_step_N, held.observed_step_N);
  row.energy_J = std::max(*row.energy_J, held.grip_J);
  row.coupled_margin = held.row.coupled_margin;
  row.passive_margin = held.row.passive_margin;
  row.grip_energy_J = held.row.grip_energy_J;
  t.judge("greatest energy given to the hand in a gesture [J]", *row.energy_J, limits.energy_J,
          fmt::format("{} of {} prescribed gestures fail ({} insertions); {} with a hand", found.failed,
                      found.gestures, found.worst.insertions, with_hand));
  if (*row.max_unexplained_step_N <= limits.step_N) return {};
  t.require(false);
  row.note += fmt::format("; a force step of {:.3g} N that no spring explains, {:.3g} N passes",
                          *row.max_unexplained_step_N, limits.step_N);
  return {};
}

// Scenes reduced to what the Desktop and this tool can render; energy of force and torque at the handle.
Status toolGestures(Trial& t) {
  const std::uint64_t gestures = Gestures::ofModel(t, "gestures");
  const double limit = t.number("limit", 0);
  RETURN_IF_ERROR(t.status());
  Gestures g(t);
  g.of.plant = t.plant;
  ASSIGN_OR_RETURN(const auto held, withHands(g, g.search.first_seed, gestures));
  t.row() = held.row;
  t.judge("greatest energy given to the hand at any moment [J]", held.row.grip_energy_J.value_or(0), limit,
          fmt::format("{} gestures, lever {:.0f} mm", gestures, 1e3 * norm(t.plant.device.X_HT.p)));
  return {};
}

// What the control is told of the device.
PassivitySettings toldOf(Trial& t) {
  PassivitySettings told = passivityOf(t.plant);
  if (!t.settings.control.uses_measured_delay) told.delay_ticks = 1, told.lag_s = 0;
  if (t.has("told")) {
    told.delay_ticks = static_cast<std::uint32_t>(t.whole("told.delay_ticks"));
    told.lag_s = t.number("told.lag_s", 0, 0.1);
    told.damping_Ns_per_m = t.number("told.damping_ns_per_m", 0, 100);
  }
  if (t.settings.control.capacity_J) told.capacity_J = *t.settings.control.capacity_J;
  return told;
}

// Lowers the scene as a station does that counts on these numbers, and returns the share.
Result<double> lowerForDelay(Trial& t) {
  if (t.has("full_stiffness") || !axialEntry(t.scene.axial_model).has_tracking_wall) return 1.0;
  const PassivitySettings told = toldOf(t);
  ASSIGN_OR_RETURN(const auto source, t.source(t.scene, t.plant.rate_hz));
  const double most = stableInLightestGrip_N_per_m(told.damping_Ns_per_m, t.plant.rate_hz,
                                                   told.delay_ticks + told.lag_s * t.plant.rate_hz);
  const double share = std::min(1.0, most / source->axialStiffness_N_per_m());
  lowerStiffness(t.scene, {.delay = share});
  return share;
}

// A loop with and without the passivity control.
struct ControlledRuns {
  PlantRun without, with;
};
// `always` false: the control is only on where passivity is not proven, as in a station.
Result<ControlledRuns> controlledRuns(Trial& t, const HandPlan& plan, bool always) {
  t.plant.passivity.reset();
  ASSIGN_OR_RETURN(auto without, t.loop(plan));
  if (!always && !(without.margins.passive < 1)) return ControlledRuns{without, without};
  t.plant.passivity = toldOf(t);
  ASSIGN_OR_RETURN(auto with, t.loop(plan));
  return ControlledRuns{std::move(without), std::move(with)};
}

// The row of the run with the control, plus the other run's energy.
CaseRow controlledRow(const ControlledRuns& runs) {
  CaseRow row = measuredRow(runs.with, {});
  row.grip_energy_J = runs.without.grip_energy_J;
  row.controlled_energy_J = runs.with.grip_energy_J;
  row.distortion_N = greatestDistortion_N(runs.with);
  return row;
}

std::string controlledNote(const CaseRow& row) {
  return fmt::format("without it {:.2g} mJ, with it {:.2g} mJ; it takes off up to {:.2g} N",
                     1e3 * row.grip_energy_J.value_or(0), 1e3 * row.controlled_energy_J.value_or(0),
                     row.distortion_N.value_or(0));
}

// Runs the path with the control.
Status withControl(Trial& t) {
  const TimedPlan path = t.path();
  const double limit_J = t.number("limit", 0);
  RETURN_IF_ERROR(t.status());
  ASSIGN_OR_RETURN(const auto runs, controlledRuns(t, path.plan, true));
  t.row() = controlledRow(runs);
  t.judge("energy given to the hand at any moment, with passivity control [J]", runs.with.grip_energy_J,
          limit_J, controlledNote(t.row()));
  return {};
}

// The swing of the force, about its mean over 0.3 s, in the last second before `to_s` for which there is one.
double restSwing_N(const PlantRun& run, double to_s) {
  constexpr double kReach_s = 0.15;  // more than half a period of the slowest swing, 5 Hz
  const auto around = static_cast<std::size_t>(kReach_s * run.rate_hz);
  const auto swing =
      aboutSlowPart(forceAlong(ticksIn(run, {to_s - 1 - 2 * kReach_s, to_s}), kInward_W), around);
  return swing.size() > 2 * around ? peakToPeak(std::span(swing).subspan(around, swing.size() - 2 * around))
                                   : 0;
}

// A late loop as in a station, its scene lowered to its delay (even below what a station takes), with the
// control where passivity is not proven: the case and its neighbours, whose grip, mass, speed and depth lie
// within the spread about the case's. One is stable if the hand gets no more than the limits, since the start
// and in any second of the hold, and the force is still in the hold's last second. The hand changes its grip
// in the window "grip_changes", if present. The row has the worst of all, but without the control the case
// alone.
Status lateContact(Trial& t) {
  const std::uint64_t all = Gestures::ofModel(t, "neighbours.count");
  const double spread = t.number("neighbours.spread", 0, 0.5),
               least = t.number("neighbours.least_stable", 0, 1), limit_J = t.number("limit", 0),
               second_limit_J = t.number("second_limit_j", 0), hold_limit_N = t.number("hold_limit_n", 0);
  HandRandom random(t.whole("neighbours.seed"));
  ASSIGN_OR_RETURN(const double share, lowerForDelay(t));
  const auto near = [&] { return 1 + spread * (2 * random.uniform() - 1); };
  const PlantOptions own = t.plant;
  std::optional<PassivitySettings> control;
  NeighbourCount count;
  std::size_t giving = 0, swinging = 0;
  std::string of_itself;
  for (; count.all < all; ++count.all) {
    const bool itself = count.all == 0;
    t.plant = own;
    t.plant.passivity = control;
    HandOptions& hand = t.plant.device.hand;
    PathChange change;
    if (!itself) {
      const double grip = near();
      hand.stiffness_N_per_m *= grip;
      hand.damping_Ns_per_m *= grip;
      t.plant.device.limits.apparent_mass_kg *= near();
      change.speed_factor = near();
      change.depth_factor = near();
    }
    const TimedPlan path = t.path("path", change);
    const TimeWindow hold = t.window(path, "hold");
    if (t.has("grip_changes")) {
      hand.grip_changes_s = t.window(path, "grip_changes").from_s;
      hand.grip_share = t.number("grip_changes.share", 0, 100);
    }
    RETURN_IF_ERROR(t.status());
    CaseRow row;
    bool held = false;
    const auto judged = [&](const PlantRun& run) {
      row = measuredRow(run, hold);
      row.controlled_energy_J = run.grip_energy_J;
      row.distortion_N = greatestDistortion_N(run);
      row.hold_swing_N = restSwing_N(run, hold.to_s);
      held = heldIn(run, hold);
    };
    if (itself) {
      ASSIGN_OR_RETURN(const auto runs, controlledRuns(t, path.plan, false));
      control = t.plant.passivity;
      judged(runs.with);
      row.grip_energy_J = runs.without.grip_energy_J;
      of_itself = controlledNote(row);
    } else {
      ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
      judged(run);
      row.grip_energy_J.reset();
    }
    const bool gives = *row.controlled_energy_J > limit_J || row.second_energy_J.value_or(0) > second_limit_J;
    const bool swings = !row.finite || held || !(*row.hold_swing_N <= hold_limit_N);
    giving += gives;
    swinging += swings;
    count.stable += !gives && !swings;
    worsen(t.row(), row);
  }
  t.row().neighbours = count;
  t.judge(
      "neighbours that stay stable", 1 - count.share(), 1 - least,
      fmt::format("{} of {} give energy, up to {:.2g} mJ since the start and {:.2g} mJ in a second; {} swing "
                  "at rest, up to {:.2g} N; at {:.0f} % of the stiffness; itself: {}",
                  giving, count.all, 1e3 * *t.row().controlled_energy_J,
                  1e3 * t.row().second_energy_J.value_or(0), swinging, *t.row().hold_swing_N, 100 * share,
                  of_itself));
  return {};
}

}  // namespace

std::vector<StabilityCase> gestureCases() {
  return {
      {"random_energy", randomEnergy, true, false},
      {"tool_gestures", toolGestures, true, false},
      {"passivity_fade_in", withControl},
      {"lag_2ms", lateContact},
      {"lag_8ms", lateContact},
      {"delay_varies", lateContact},
      {"loose_tap", lateContact},
      {"grip_changes", lateContact},
      {"backlash", lateContact},
      {"late_rest", lateContact},
  };
}

}  // namespace needlelab
