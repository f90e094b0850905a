/// Random gestures in random scenes under the passivity observer: prescribed, and made by a simulated hand.
#include <algorithm>

#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/motion_run.h"
#include "client/sim/stability/passivity_search.h"
#include "common/base/text.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

// Net energy that came out at the hand's grip: what the device rendered, less what its own damping took and
// its mass has at the end.
double energyAtGrip_J(const PlantRun& run, const SimulatedDeviceOptions& device) {
  double damped_J = 0;
  for (const PlantTick& tick : run.ticks)
    damped_J += device.limits.damping_Ns_per_m * normSquared(tick.v_W_mps) / run.rate_hz;
  const PlantTick& last = run.ticks.back();
  return last.energy_J - damped_J - 0.5 * device.limits.apparent_mass_kg * normSquared(last.v_W_mps);
}

// The gate lets the force fade in over the first 200 ms (§3.7). A spring that is pressed meanwhile gives back
// more than it took: a gesture begins after it.
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
};

Result<WithHand> withHands(std::uint64_t gestures, const PassivitySearch& search, PlantOptions plant,
                           const std::vector<Grip>& hands, AxialModel model,
                           const ForceSourceFactory& make_source) {
  WithHand worst;
  for (std::uint64_t seed = search.first_seed; seed < search.first_seed + gestures; ++seed) {
    const PassivityGesture gesture = randomGesture(seed, shapeOf(seed), search.range);
    const auto scene = sceneSpecOf(gesture.profile);
    if (!scene.ok()) return scene.error();
    auto source = make_source(likeForLike(*scene, model), plant.rate_hz);
    if (!source.ok()) return source.error();
    const Grip& hand = hands[seed % hands.size()];
    plant.device.hand.stiffness_N_per_m = hand.stiffness_N_per_m;
    plant.device.hand.damping_Ns_per_m = hand.damping_Ns_per_m;
    plant.device.hand.tremor_m = gesture.tremor_m;
    plant.device.hand.seed = gesture.tremor_seed;
    const auto run = runPlant(**source, restedPlan(gesture), plant);
    if (!run.ok()) return run.error();

    PassivityObserver observer(run->axial_stiffness_N_per_m);
    for (const PlantTick& tick : run->ticks)
      if (tick.stepped) observer.add(tick.seen, tick.report, tick.slant);
    const PassivityRecord& record = observer.record();
    worst.finite = worst.finite && record.finite;
    worst.step_N = std::max(worst.step_N, record.worst_step_N);
    worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
    worst.grip_J = std::max(worst.grip_J, energyAtGrip_J(*run, plant.device));
  }
  return worst;
}

}  // namespace

Result<CaseOutcome> randomEnergy(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "random_energy", settings.long_form);
  PassivitySearch search;
  const bool wall = model == AxialModel::kEnhancedTrackingWall;
  search.gestures = entry.whole(wall ? "gestures" : "gestures_of_other_models", 1);
  const std::uint64_t with_hand = entry.whole(wall ? "with_hand" : "with_hand_of_other_models");
  search.first_seed = entry.whole("first_seed");
  search.rate_hz = entry.number("rate_hz", 50, 40'000);
  search.limits.energy_J = entry.number("limit", 0);
  search.limits.step_N = entry.number("step_limit_n", 0);
  // shrinking asks for hundreds of scenes, each of which would need a mesh of its own
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
  std::vector<Grip> hands;
  for (std::size_t i = 0; i < std::min(stiffness.size(), damping.size()); ++i)
    hands.push_back({stiffness[i], damping[i]});
  const PlantOptions plant = entry.plant();
  if (!entry.status().ok()) return entry.status().error();

  const auto found = searchGestures(search, model, source);
  if (!found.ok()) return found.error();
  const auto held = withHands(with_hand, search, plant, hands, model, source);
  if (!held.ok()) return held.error();

  CaseOutcome outcome{rowOf(found->worst)};
  CaseRow& row = outcome.row;
  row.finite = row.finite && held->finite;
  row.max_force_N = std::max(*row.max_force_N, held->max_force_N);
  row.max_unexplained_step_N = std::max(*row.max_unexplained_step_N, held->step_N);
  row.energy_J = std::max(*row.energy_J, held->grip_J);
  judgeMotion(row, "greatest energy given to the hand in a gesture [J]", *row.energy_J,
              search.limits.energy_J);
  if (*row.max_unexplained_step_N > search.limits.step_N) {
    row.passed = false;
    if (row.verdict == Verdict::kStable) row.verdict = Verdict::kChatters;
  }
  row.note = std::to_string(found->failed) + " of " + std::to_string(found->gestures) +
             " prescribed gestures fail (" + std::to_string(found->worst.insertions) + " insertions); " +
             std::to_string(with_hand) + " with a hand";
  if (*row.max_unexplained_step_N > search.limits.step_N)
    row.note += formatted("; a force step of %.3g N that no spring explains, %.3g N passes",
                          *row.max_unexplained_step_N, search.limits.step_N);
  for (const CounterExample& example : found->counter_examples)
    outcome.files.push_back(
        {"random_energy-" + search.source_name + "-" + std::to_string(example.seed) + ".json",
         counterExampleJson(example)});
  return outcome;
}

}  // namespace needlelab
