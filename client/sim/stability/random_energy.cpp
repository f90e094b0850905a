/// Random gestures in random scenes under the passivity observer, prescribed and with a hand.

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/passivity_observer.h"
#include "client/sim/stability/passivity_search.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/haptics/handle_stiffness.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

// Net energy delivered at the hand's grip: the device's rendered work, minus the losses in its own damping
// and the final kinetic energy of its mass.
double energyAtGrip_J(const PlantRun& run, const SimulatedDeviceOptions& device) {
  double damped_J = 0;
  for (const PlantTick& tick : run.ticks)
    damped_J += device.limits.damping_Ns_per_m * normSquared(tick.v_W_mps) / run.rate_hz;
  const PlantTick& last = run.ticks.back();
  return last.energy_J - damped_J - 0.5 * device.limits.apparent_mass_kg * normSquared(last.v_W_mps);
}

// The gate fades the force in over the first 200 ms (§3.7). A spring pressed meanwhile gives back more than
// it took, so gestures begin after the fade-in.
HandPlan restedPlan(PassivityGesture gesture) {
  PassivityStroke rest = gesture.start;
  rest.seconds = 0.25;
  gesture.strokes.insert(gesture.strokes.begin(), rest);
  return planOf(gesture);
}

// a hand that may be stiff, normal or nearly free
struct Grip {
  double stiffness_N_per_m, damping_Ns_per_m;
};

struct WithHand {
  double grip_J = -1e9, step_N = 0, max_force_N = 0;
  bool finite = true;
  CaseRow row;  ///< margins and greatest energy at the grip
};

// the hand of the gesture's seed, in `plant`
void take(const PassivityGesture& gesture, std::uint64_t seed, const std::vector<Grip>& hands,
          PlantOptions& plant) {
  const Grip& hand = hands[seed % hands.size()];
  plant.device.hand.stiffness_N_per_m = hand.stiffness_N_per_m;
  plant.device.hand.damping_Ns_per_m = hand.damping_Ns_per_m;
  plant.device.hand.tremor_m = gesture.tremor_m;
  plant.device.hand.seed = gesture.tremor_seed;
}

// as a station renders it with the tool of `plant`
Result<SceneSpec> mounted(SceneSpec scene, const PlantOptions& plant, const ForceSourceFactory& make_source) {
  if (plant.device.X_HT == Pose{}) return scene;
  ASSIGN_OR_RETURN(const auto source, make_source(scene, plant.rate_hz));
  lowerStiffness(scene, heldStiffnessShare(scene, source->axialStiffness_N_per_m(), plant.device.limits,
                                           plant.device.X_HT));
  return scene;
}

Result<WithHand> withHands(std::uint64_t gestures, const PassivitySearch& search, PlantOptions plant,
                           const std::vector<Grip>& hands, AxialModel model,
                           const ForceSourceFactory& make_source) {
  WithHand worst;
  worst.row.finite = true;
  for (std::uint64_t seed = search.first_seed; seed < search.first_seed + gestures; ++seed) {
    const PassivityGesture gesture = randomGesture(seed, shapeOf(seed), search.range);
    ASSIGN_OR_RETURN(const auto given, sceneSpecOf(gesture.profile));
    ASSIGN_OR_RETURN(const auto scene, mounted(likeForLike(given, model), plant, make_source));
    ASSIGN_OR_RETURN(auto source, make_source(scene, plant.rate_hz));
    take(gesture, seed, hands, plant);
    ASSIGN_OR_RETURN(const auto run, runPlant(*source, restedPlan(gesture), plant));

    PassivityObserver observer(run.axial_stiffness_N_per_m);
    for (const PlantTick& tick : run.ticks)
      if (tick.stepped) observer.add(tick.seen, tick.report, tick.slant);
    const PassivityRecord& record = observer.record();
    worst.finite = worst.finite && record.finite;
    worst.step_N = std::max(worst.step_N, record.worst_step_N);
    worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
    worst.grip_J = std::max(worst.grip_J, energyAtGrip_J(run, plant.device));
    worsen(worst.row, measuredRow(run, {}, {}));
  }
  return worst;
}

// the numbers of the entry `random_energy`
struct RandomGestures {
  PassivitySearch search;
  std::uint64_t with_hand = 0;
  PlantOptions plant;
  std::vector<Grip> hands;
};

Result<RandomGestures> randomGestures(const CaseSettings& settings, AxialModel model) {
  CaseEntry entry(settings.file, "random_energy", settings.long_form);
  RandomGestures of;
  PassivitySearch& search = of.search;
  const bool wall = model == AxialModel::kEnhancedTrackingWall;
  search.gestures = entry.whole(wall ? "gestures" : "gestures_of_other_models", 1);
  search.with_stages = entry.whole(wall ? "with_stages" : "with_stages_of_other_models");
  of.with_hand = entry.whole(wall ? "with_hand" : "with_hand_of_other_models");
  search.first_seed = entry.whole("first_seed");
  search.rate_hz = entry.number("rate_hz", 50, 40'000);
  search.limits.energy_J = entry.number("limit", 0);
  search.limits.step_N = entry.number("step_limit_n", 0);
  // shrinking needs hundreds of scenes, each with its own mesh
  search.most_counter_examples =
      model == AxialModel::kFem ? 0 : static_cast<std::size_t>(entry.whole("most_counter_examples"));
  search.source_name = std::string(axialModelName(model));
  search.range.most_depth_m = entry.number("range.most_depth_m", 0.002, 0.2);
  search.range.most_aside_m = entry.number("range.most_aside_m", 1e-3, 0.2);
  search.range.most_speed_mps = entry.number("range.most_speed_m_s", 1e-3, 1);
  search.range.most_turn_radps = entry.number("range.most_turn_rad_s", 0.1, 100);
  search.range.most_tilt = entry.number("range.most_tilt", 0, 10);
  search.range.all_effects_share = entry.number("range.all_effects_share", 0, 1);
  const auto stiffness = entry.numbers("hands_n_per_m"), damping = entry.numbers("hands_ns_per_m");
  for (std::size_t i = 0; i < std::min(stiffness.size(), damping.size()); ++i)
    of.hands.push_back({stiffness[i], damping[i]});
  of.plant = entry.plant();
  if (!entry.status().ok()) return entry.status().error();
  return of;
}

}  // namespace

Result<CaseOutcome> randomEnergy(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  ASSIGN_OR_RETURN(const auto of, randomGestures(settings, model));
  const PassivitySearch& search = of.search;
  ASSIGN_OR_RETURN(const auto found, searchGestures(search, model, source));
  ASSIGN_OR_RETURN(const auto held, withHands(of.with_hand, search, of.plant, of.hands, model, source));

  CaseOutcome outcome{rowOf(found.worst)};
  CaseRow& row = outcome.row;
  row.finite = row.finite && held.finite;
  row.max_force_N = std::max(*row.max_force_N, held.max_force_N);
  row.max_unexplained_step_N = std::max(*row.max_unexplained_step_N, held.step_N);
  row.energy_J = std::max(*row.energy_J, held.grip_J);
  row.coupled_margin = held.row.coupled_margin;
  row.passive_margin = held.row.passive_margin;
  row.grip_energy_J = held.row.grip_energy_J;
  judgeMotion(row, "greatest energy given to the hand in a gesture [J]", *row.energy_J,
              search.limits.energy_J);
  if (*row.max_unexplained_step_N > search.limits.step_N) {
    row.passed = false;
    if (row.verdict == Verdict::kStable) row.verdict = Verdict::kChatters;
  }
  row.note = fmt::format("{} of {} prescribed gestures fail ({} insertions); {} with a hand", found.failed,
                         found.gestures, found.worst.insertions, of.with_hand);
  if (*row.max_unexplained_step_N > search.limits.step_N)
    row.note += fmt::format("; a force step of {:.3g} N that no spring explains, {:.3g} N passes",
                            *row.max_unexplained_step_N, search.limits.step_N);
  for (const CounterExample& example : found.counter_examples)
    outcome.files.push_back({fmt::format("random_energy-{}-{}.json", search.source_name, example.seed),
                             counterExampleJson(example)});
  return outcome;
}

// The one gesture of 4,000 outside the case's seeds that gets energy from a loop that is late. Judged at the
// case's own rate and delay; the same gesture without delay and at twice the rate is told beside it.
Result<CaseOutcome> randomEnergySeed(const CaseSettings& settings, AxialModel model,
                                     const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "random_energy_500981", settings.long_form);
  const std::uint64_t seed = entry.whole("seed", 1);
  const double limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(auto of, randomGestures(settings, model));
  of.search.first_seed = seed;
  const auto given = [&](const PlantOptions& plant) {
    return withHands(1, of.search, plant, of.hands, model, source);
  };
  PlantOptions at_once = of.plant, faster = of.plant;
  at_once.device.delay_ticks = 0;
  faster.rate_hz *= 2;
  ASSIGN_OR_RETURN(auto late, given(of.plant));
  const double without_J = late.grip_J;
  // as a station does where passivity is not proven
  if (late.row.passive_margin && *late.row.passive_margin < 1) {
    of.plant.passivity = passivityOf(of.plant);
    ASSIGN_OR_RETURN(late, given(of.plant));
  }
  ASSIGN_OR_RETURN(const auto in_time, given(at_once));
  ASSIGN_OR_RETURN(const auto fast, given(faster));

  CaseOutcome outcome;
  CaseRow& row = outcome.row;
  row = late.row;
  row.max_unexplained_step_N = late.step_N;
  row.energy_J = late.grip_J;
  row.grip_energy_J = without_J;
  row.controlled_energy_J = late.grip_J;
  judgeMotion(row, "energy given to the hand in the gesture [J]", late.grip_J, limit);
  const auto inMillijoules = [](double energy_J) { return fmt::format("{:.2g} mJ", energy_J * 1e3); };
  row.note =
      fmt::format("without the control {}; and without delay {}, at {:g} Hz {}", inMillijoules(without_J),
                  inMillijoules(in_time.grip_J), faster.rate_hz, inMillijoules(fast.grip_J));
  return outcome;
}

namespace {

// fewer for the other models: FEM makes a mesh for each
std::uint64_t gesturesOf(CaseEntry& entry, AxialModel model) {
  return entry.whole(model == AxialModel::kEnhancedTrackingWall ? "gestures" : "gestures_of_other_models", 1);
}

}  // namespace

// Scenes lowered to what the Desktop and this tool hold; energy of force and torque at the handle.
Result<CaseOutcome> toolGestures(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "tool_gestures", settings.long_form);
  const std::uint64_t gestures = gesturesOf(entry, model);
  const PlantOptions plant = entry.plant();
  const double limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto of, randomGestures(settings, model));
  ASSIGN_OR_RETURN(const auto held, withHands(gestures, of.search, plant, of.hands, model, source));
  CaseOutcome outcome;
  outcome.row = held.row;
  judgeMotion(outcome.row, "greatest energy given to the hand at any moment [J]",
              held.row.grip_energy_J.value_or(0), limit);
  outcome.row.note = fmt::format("{} gestures, lever {:.0f} mm", gestures, 1e3 * norm(plant.device.X_HT.p));
  return outcome;
}

namespace {

struct ControlledGestures {
  CaseRow worst;
  std::uint64_t touched = 0;  ///< gestures of which more is taken off than a hand notices
  /// The most that is taken off a gesture that got no more than the reserve without it.
  double passive_touched_N = 0;
};

// gestures from `first_seed` on, with the passivity control and without
Result<ControlledGestures> controlledGestures(const RandomGestures& of, std::uint64_t first_seed,
                                              std::uint64_t gestures, AxialModel model,
                                              const ForceSourceFactory& source) {
  ControlledGestures all;
  all.worst.finite = true;
  PlantOptions plant = of.plant;
  for (std::uint64_t seed = first_seed; seed < first_seed + gestures; ++seed) {
    const PassivityGesture gesture = randomGesture(seed, shapeOf(seed), of.search.range);
    ASSIGN_OR_RETURN(const auto scene, sceneSpecOf(gesture.profile));
    take(gesture, seed, of.hands, plant);
    ASSIGN_OR_RETURN(const auto runs,
                     controlledRuns(source, likeForLike(scene, model), restedPlan(gesture), plant));
    CaseRow row = measuredRow(runs.with, {}, {});
    row.grip_energy_J.reset();
    putControlled(row, runs);
    worsen(all.worst, row);
    const double off_N = row.distortion_N.value_or(0);
    if (off_N > kNoticeableStep_N) ++all.touched;
    if (runs.without.grip_energy_J <= PassivitySettings{}.reserve_J)
      all.passive_touched_N = std::max(all.passive_touched_N, off_N);
  }
  return all;
}

}  // namespace

// Where the device damps enough for the loop to be passive, what gives no energy is left as it is: no more is
// taken off than a hand would notice.
Result<CaseOutcome> passivityTransparent(const CaseSettings& settings, AxialModel model,
                                         const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "passivity_transparent", settings.long_form);
  const std::uint64_t gestures = gesturesOf(entry, model);
  const PlantOptions plant = entry.plant();
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(auto of, randomGestures(settings, model));
  of.plant = plant;
  ASSIGN_OR_RETURN(const auto controlled,
                   controlledGestures(of, of.search.first_seed, gestures, model, source));
  CaseOutcome outcome;
  outcome.row = controlled.worst;
  judgeMotion(outcome.row, "force taken off gestures that give no energy [N]", controlled.passive_touched_N,
              kNoticeableStep_N);
  outcome.row.note = fmt::format("{} of {} gestures are touched; {}", controlled.touched, gestures,
                                 controlledNote(outcome.row));
  return outcome;
}

}  // namespace needlelab
