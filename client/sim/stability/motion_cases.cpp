#include "client/sim/stability/motion_cases.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/sim/stability/passivity_observer.h"
#include "client/sim/stability/passivity_search.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

// a case of the gate: as shipped, with it
template <auto Run>
Result<CaseOutcome> gated(const CaseSettings& settings, AxialModel model, const ForceSourceFactory& source) {
  return Run(settings, model, source, Gate::kPresent);
}

}  // namespace

std::vector<StabilityCase> motionCases() {
  return {
      {"retreat_in_ramp", "the needle is drawn back while the force of a stop fades", true, true,
       retreatInRamp},
      {"clamp_pump", "aside while shallow, in, back, out: the fixture must not pay", false, true, clampPump},
      {"tilt_pump", "tilted while shallow, in, upright, out: the tilt limit must not pay", false, true,
       tiltPump},
      {"turn_wide", "30 mm aside at 12 mm deep: the trajectory turns without a step", false, true, turnWide},
      {"grazing_85deg", "a needle nearly flat on the skin, in and out", false, true, grazing85},
      {"exit_normal", "the pull on the way out fades to nothing at the skin", true, true, exitNormal},
      {"sphere_far_side", "in on one side of a limb and out on the other", true, true, sphereFarSide},
      {"beyond_the_needle", "deeper than the needle is long, and out", true, true, beyondTheNeedle},
      {"starts_inside", "the station starts with the tip in the tissue", true, true, startsInside},
      {"teleport", "the tip jumps by 50 mm", true, true, gated<teleport>},
      {"not_a_number", "position or orientation is not a number", true, true, gated<notANumber>},
      {"frozen_device", "the device stands still, or says nothing more", true, true, gated<frozenDevice>},
      {"flipped_axis", "the needle points out of the tissue; samples of any kind", true, true,
       gated<flippedAxis>},
      {"random_energy", "random gestures in random scenes under the passivity observer", true, true,
       randomEnergy},
  };
}

Result<MotionRun> runMotion(const ForceSourceFactory& make_source, const SceneSpec& scene,
                            const std::vector<TipSample>& samples, double rate_hz) {
  ASSIGN_OR_RETURN(auto source, make_source(scene, rate_hz));
  MotionRun run{rate_hz, source->axialStiffness_N_per_m(), {}};
  run.ticks.reserve(samples.size());
  for (const TipSample& tip : samples) {
    MotionTick& tick = run.ticks.emplace_back();
    tick.tip = tip;
    source->step(tip, tick.report);
    tick.slant = source->slant();
  }
  return run;
}

std::vector<TipSample> samplesOf(const HandPlan& plan, double rate_hz) {
  const auto ticks = static_cast<std::size_t>(std::floor(plan.duration_s() * rate_hz + 0.5)) + 1;
  std::vector<TipSample> samples;
  samples.reserve(ticks);
  for (std::size_t k = 0; k < ticks; ++k) {
    const Pose pose = plan.at(static_cast<double>(k) / rate_hz).X_WT;
    samples.push_back({pose.p, pose.q});
  }
  return samples;
}

Result<PassivityGesture> motionOf(const CaseSettings& settings, std::string_view case_name,
                                  std::string_view field) {
  const auto& cases = settings.file.json().at("cases");
  const std::string name(case_name), key(field);
  const std::string where = settings.file.source() + ": cases." + name + "." + key;
  const auto found = cases.find(name);
  if (found == cases.end() || !found->is_object() || !found->contains(key))
    return Error{ErrorCode::kInvalidInput, where + ": missing"};
  PassivityGesture gesture;
  RETURN_IF_ERROR(readMotion((*found)[key], where, gesture));
  return gesture;
}

PassivityRecord observed(const MotionRun& run, bool with_slant) {
  PassivityObserver observer(run.axial_stiffness_N_per_m);
  for (const MotionTick& tick : run.ticks) observer.add(tick.tip, tick.report, with_slant ? tick.slant : 1.0);
  return observer.record();
}

CaseRow rowOf(const PassivityRecord& record) {
  CaseRow row;
  row.finite = record.finite;
  row.max_force_N = record.max_force_N;
  row.max_unexplained_step_N = record.worst_step_N;
  row.energy_J = judgedEnergy_J(record);
  return row;
}

CaseRow rowOf(const std::vector<GatedTick>& ticks) {
  CaseRow row;
  row.finite = true;
  row.max_force_N = 0;
  for (const GatedTick& tick : ticks) {
    row.finite = row.finite && isFinite(tick.out_W.force_N) && isFinite(tick.out_W.torque_Nm);
    row.max_force_N = std::max(*row.max_force_N, norm(tick.out_W.force_N));
  }
  return row;
}

void judgeMotion(CaseRow& row, std::string quantity, double measured, double limit) {
  row.quantity = std::move(quantity);
  row.measured = measured;
  row.limit = limit;
  judge(row, false);
}

CaseTrace forceTrace(const MotionRun& run, std::string label) {
  CaseTrace trace{std::move(label), {}, {}};
  for (std::size_t k = 0; k < run.ticks.size(); ++k) {
    trace.time_s.push_back(static_cast<double>(k) / run.rate_hz);
    trace.force_N.push_back(norm(run.ticks[k].report.wrench_W.force_N));
  }
  return trace;
}

namespace {

// the models with a tracking wall: their force fades in a stop
double axialOf(const StepReport& report) {
  return report.cutting_N + report.attracted_N;
}

// Energy that the wall gave to the hand from tick `from` on, minus the energy released by its spring (f²/2K)
// since then; greatest over the ticks with a still tip.
double createdEnergy(const MotionRun& run, std::size_t from, double stiffness) {
  const auto stored = [&](std::size_t k) {
    const double f = axialOf(run.ticks[k].report);
    return f * f / (2 * stiffness);
  };
  double work = 0, created = 0;
  for (std::size_t k = from + 1; k < run.ticks.size(); ++k) {
    const MotionTick &before = run.ticks[k - 1], &now = run.ticks[k];
    const double way = -(now.tip.p_WT_m.z - before.tip.p_WT_m.z);
    work += 0.5 * (axialOf(before.report) + axialOf(now.report)) * way;
    if (way == 0) created = std::max(created, work + stored(k) - stored(from));
  }
  return created;
}

double greatestStep(const MotionRun& run, std::size_t from, std::size_t to) {
  double step = 0;
  for (std::size_t k = std::max<std::size_t>(from, 1); k < std::min(to, run.ticks.size()); ++k)
    step =
        std::max(step, norm(run.ticks[k].report.wrench_W.force_N - run.ticks[k - 1].report.wrench_W.force_N));
  return step;
}

std::size_t tickAt(double time_s, double rate_hz) {
  return static_cast<std::size_t>(time_s * rate_hz + 0.5);
}

}  // namespace

Result<CaseOutcome> retreatInRamp(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseOutcome outcome;
  if (!hasStop(model)) {
    outcome.row.note = "has no stop: there is no ramp to retreat in";
    return outcome;
  }
  CaseEntry entry(settings.file, "retreat_in_ramp", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double depth = entry.number("depth_m", 0.005, 0.05), speed_in = entry.number("speed_in_m_s", 1e-3, 1);
  const double rest_s = entry.number("rest_s", 0.1, 10), rate = entry.number("rate_hz", 50, 40'000);
  const auto retreats = entry.numbers("retreats_m"), speeds = entry.numbers("speeds_m_s");
  const auto waits = entry.numbers("after_s");
  const double limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();

  const auto at = [](double d) { return Pose{{0, 0, -d}, orientationAlong({0, 0, -1})}; };
  double created = 0;
  PassivityRecord worst;
  for (const double retreat : retreats)
    for (const double speed : speeds)
      for (const double wait : waits) {
        HandPlan plan(at(-0.002));
        plan.moveTo(at(depth), speed_in, Motion::kLinear).hold(wait);
        const std::size_t from = tickAt(plan.duration_s(), rate);
        plan.moveIn(at(depth - retreat), retreat / speed, Motion::kLinear).hold(rest_s);
        plan.moveIn(at(depth), retreat / speed, Motion::kLinear).hold(rest_s);
        ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(plan, rate), rate));
        created = std::max(created, createdEnergy(run, from, scene.tracking_wall.stiffness_N_per_m));
        const PassivityRecord record = observed(run);
        worst.finite = worst.finite && record.finite;
        worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
        worst.worst_step_N = std::max(worst.worst_step_N, record.worst_step_N);
        if (outcome.traces.empty() && retreat == retreats.back())
          outcome.traces.push_back(forceTrace(run, std::string(axialModelName(model))));
      }
  outcome.row = rowOf(worst);
  outcome.row.energy_J = created;
  judgeMotion(outcome.row, "energy given beyond what the spring had stored [J]", created, limit);
  return outcome;
}

Result<CaseOutcome> exitNormal(const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "exit_normal", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const TimedPlan path = entry.path();
  const TimeWindow window = entry.window(path);
  const double rate = entry.number("rate_hz", 50, 40'000), limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(path.plan, rate), rate));
  CaseOutcome outcome{rowOf(observed(run)), {forceTrace(run, std::string(axialModelName(model)))}};
  const double step = greatestStep(run, tickAt(window.from_s, rate), tickAt(window.to_s, rate));
  judgeMotion(outcome.row, "greatest force step on the last of the way out [N]", step, limit);
  return outcome;
}

Result<CaseOutcome> sphereFarSide(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "sphere_far_side", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const TimedPlan path = entry.path();
  const double rate = entry.number("rate_hz", 50, 40'000), above = entry.number("limit_above_cutting_n", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(path.plan, rate), rate));
  CaseOutcome outcome{rowOf(observed(run)), {forceTrace(run, std::string(axialModelName(model)))}};
  judgeMotion(outcome.row, "greatest force step, the far side included [N]",
              greatestStep(run, 1, run.ticks.size()), scene.layers.front().cutting_force_N + above);
  if (!(run.ticks.back().report.depth_m < 0)) outcome.row.passed = false;
  return outcome;
}

Result<CaseOutcome> beyondTheNeedle(const CaseSettings& settings, AxialModel model,
                                    const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "beyond_the_needle", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double limit = entry.number("limit", 0), torque_limit = entry.number("torque_limit_nm", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto motion, motionOf(settings, "beyond_the_needle"));
  ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(motion), motion.rate_hz));

  const PassivityRecord record = observed(run);
  CaseOutcome outcome{rowOf(record), {forceTrace(run, std::string(axialModelName(model)))}};
  judgeMotion(outcome.row, "greatest force step beyond the springs' slope [N]", record.worst_step_N, limit);
  // the run must have reached this region, and torque must not step either
  if (!(record.flags & kFlagBeyondNeedle) || record.worst_torque_step_Nm > torque_limit) {
    outcome.row.passed = false;
    outcome.row.verdict = Verdict::kChatters;
    outcome.row.note = fmt::format("torque steps by {:f} N·m", record.worst_torque_step_Nm);
  }
  return outcome;
}

namespace {

// the case's motion in its scene
struct Prescribed {
  SceneSpec scene;
  PassivityGesture motion;
  double limit = 0;
};

Result<Prescribed> prescribed(const CaseSettings& settings, std::string_view name, AxialModel model) {
  CaseEntry entry(settings.file, name, settings.long_form);
  Prescribed out;
  out.scene = entry.scene(model);
  out.limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(auto motion, motionOf(settings, name));
  out.motion = std::move(motion);
  return out;
}

std::string millijoules(double energy_J) {
  return fmt::format("{:.3g} mJ", energy_J * 1e3);
}

}  // namespace

Result<CaseOutcome> clampPump(const CaseSettings& settings, AxialModel model,
                              const ForceSourceFactory& source) {
  ASSIGN_OR_RETURN(auto given, prescribed(settings, "clamp_pump", model));
  const auto samples = samplesOf(given.motion);
  CaseOutcome outcome;
  std::array<double, 2> net_J{};  // of the scene's own mode, and of the other
  for (const ClampingMode mode : {ClampingMode::kProportional, ClampingMode::kPassive}) {
    const bool own = mode == given.scene.virtual_fixture.mode;
    SceneSpec scene = given.scene;
    scene.virtual_fixture.mode = mode;
    ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samples, given.motion.rate_hz));
    const PassivityRecord record = observed(run);
    net_J[own ? 0 : 1] = record.net_J;
    outcome.traces.push_back(forceTrace(run, mode == ClampingMode::kPassive ? "PASSIVE" : "PROPORTIONAL"));
    if (own) outcome.row = rowOf(record);
  }
  outcome.row.energy_J = net_J[0];
  judgeMotion(outcome.row, "net energy given in a cycle aside, in, back, out [J]", net_J[0], given.limit);
  if (given.scene.virtual_fixture.mode == ClampingMode::kPassive)
    outcome.row.note = "PROPORTIONAL gives " + millijoules(net_J[1]);
  return outcome;
}

Result<CaseOutcome> tiltPump(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  ASSIGN_OR_RETURN(auto given, prescribed(settings, "tilt_pump", model));
  ASSIGN_OR_RETURN(const auto run,
                   runMotion(source, given.scene, samplesOf(given.motion), given.motion.rate_hz));
  const PassivityRecord record = observed(run);
  CaseOutcome outcome{rowOf(record), {}};
  outcome.row.energy_J = record.net_J;
  judgeMotion(outcome.row, "net energy given in a cycle tilt, in, upright, out [J]", record.net_J,
              given.limit);
  return outcome;
}

Result<CaseOutcome> turnWide(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  ASSIGN_OR_RETURN(auto given, prescribed(settings, "turn_wide", model));
  CaseOutcome outcome;
  PassivityRecord worst;
  for (const ClampingMode mode : {ClampingMode::kProportional, ClampingMode::kPassive}) {
    given.scene.virtual_fixture.mode = mode;
    ASSIGN_OR_RETURN(const auto run,
                     runMotion(source, given.scene, samplesOf(given.motion), given.motion.rate_hz));
    const PassivityRecord record = observed(run, false);
    worst.finite = worst.finite && record.finite && (record.flags & kFlagTurn);
    worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
    worst.worst_step_N = std::max(worst.worst_step_N, record.worst_step_N);
    worst.worst_running_J = std::max(worst.worst_running_J, record.worst_running_J);
    outcome.traces.push_back(forceTrace(run, mode == ClampingMode::kPassive ? "PASSIVE" : "PROPORTIONAL"));
  }
  outcome.row = rowOf(worst);
  judgeMotion(outcome.row, "greatest force step beyond ΣK·|Δp| [N]", worst.worst_step_N, given.limit);
  return outcome;
}

Result<CaseOutcome> grazing85(const CaseSettings& settings, AxialModel model,
                              const ForceSourceFactory& source) {
  ASSIGN_OR_RETURN(auto given, prescribed(settings, "grazing_85deg", model));
  ASSIGN_OR_RETURN(const auto run,
                   runMotion(source, given.scene, samplesOf(given.motion), given.motion.rate_hz));
  const PassivityRecord record = observed(run);
  // the case is about entries and exits
  double step = 0;
  for (std::size_t k = 1; k < run.ticks.size(); ++k)
    step = std::max(
        step, norm(run.ticks[k].report.wrench_W.torque_Nm - run.ticks[k - 1].report.wrench_W.torque_Nm));
  CaseOutcome outcome{rowOf(record), {}};
  judgeMotion(outcome.row, "greatest torque step [N·m]", step, given.limit);
  outcome.row.note = fmt::format("{} entries", record.insertions);
  return outcome;
}

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
};

Result<WithHand> withHands(std::uint64_t gestures, const PassivitySearch& search, PlantOptions plant,
                           const std::vector<Grip>& hands, AxialModel model,
                           const ForceSourceFactory& make_source) {
  WithHand worst;
  for (std::uint64_t seed = search.first_seed; seed < search.first_seed + gestures; ++seed) {
    const PassivityGesture gesture = randomGesture(seed, shapeOf(seed), search.range);
    ASSIGN_OR_RETURN(const auto scene, sceneSpecOf(gesture.profile));
    ASSIGN_OR_RETURN(auto source, make_source(likeForLike(scene, model), plant.rate_hz));
    const Grip& hand = hands[seed % hands.size()];
    plant.device.hand.stiffness_N_per_m = hand.stiffness_N_per_m;
    plant.device.hand.damping_Ns_per_m = hand.damping_Ns_per_m;
    plant.device.hand.tremor_m = gesture.tremor_m;
    plant.device.hand.seed = gesture.tremor_seed;
    ASSIGN_OR_RETURN(const auto run, runPlant(*source, restedPlan(gesture), plant));

    PassivityObserver observer(run.axial_stiffness_N_per_m);
    for (const PlantTick& tick : run.ticks)
      if (tick.stepped) observer.add(tick.seen, tick.report, tick.slant);
    const PassivityRecord& record = observer.record();
    worst.finite = worst.finite && record.finite;
    worst.step_N = std::max(worst.step_N, record.worst_step_N);
    worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
    worst.grip_J = std::max(worst.grip_J, energyAtGrip_J(run, plant.device));
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
  std::vector<Grip> hands;
  for (std::size_t i = 0; i < std::min(stiffness.size(), damping.size()); ++i)
    hands.push_back({stiffness[i], damping[i]});
  const PlantOptions plant = entry.plant();
  if (!entry.status().ok()) return entry.status().error();

  ASSIGN_OR_RETURN(const auto found, searchGestures(search, model, source));
  ASSIGN_OR_RETURN(const auto held, withHands(with_hand, search, plant, hands, model, source));

  CaseOutcome outcome{rowOf(found.worst)};
  CaseRow& row = outcome.row;
  row.finite = row.finite && held.finite;
  row.max_force_N = std::max(*row.max_force_N, held.max_force_N);
  row.max_unexplained_step_N = std::max(*row.max_unexplained_step_N, held.step_N);
  row.energy_J = std::max(*row.energy_J, held.grip_J);
  judgeMotion(row, "greatest energy given to the hand in a gesture [J]", *row.energy_J,
              search.limits.energy_J);
  if (*row.max_unexplained_step_N > search.limits.step_N) {
    row.passed = false;
    if (row.verdict == Verdict::kStable) row.verdict = Verdict::kChatters;
  }
  row.note = fmt::format("{} of {} prescribed gestures fail ({} insertions); {} with a hand", found.failed,
                         found.gestures, found.worst.insertions, with_hand);
  if (*row.max_unexplained_step_N > search.limits.step_N)
    row.note += fmt::format("; a force step of {:.3g} N that no spring explains, {:.3g} N passes",
                            *row.max_unexplained_step_N, search.limits.step_N);
  for (const CounterExample& example : found.counter_examples)
    outcome.files.push_back({fmt::format("random_energy-{}-{}.json", search.source_name, example.seed),
                             counterExampleJson(example)});
  return outcome;
}

}  // namespace needlelab
