/// The closed-loop cases of a load: a hand that lets go under it, motors too hot for it, a fixture at the end
/// of the tool's lever, and bone under a slanting needle. Private to this folder.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/scan_nudge.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {

/// A hand lets go of a needle that is pressed against a membrane, or against 4 N of tissue.
static Result<CaseOutcome> releaseUnderLoad(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Above the continuous limit the gate lowers the force; the load goes and comes back while it does.
static Result<CaseOutcome> deratedRelease(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// The fixture's force acts at the tip, the hand and the device on the handle.
static Result<CaseOutcome> leverClamping(const CaseSettings&, AxialModel, const ForceSourceFactory&);
/// Pressed on bone and drawn along it, on each device: it holds, and comes to rest.
static Result<CaseOutcome> obliqueBone(const CaseSettings&, AxialModel, const ForceSourceFactory&);

std::vector<StabilityCase> loadCases() {
  return {
      {"release_under_load", "the hand lets go of a needle pressed against a membrane, and against 4 N", true,
       false, releaseUnderLoad},
      {"derated_release", "the motors are too hot for the load, which goes and comes back", true, false,
       deratedRelease},
      {"lever_clamping", "pushed aside in the fixture, with the tool's lever of 0.13 m", true, false,
       leverClamping},
      {"oblique_bone", "pressed on bone at 0 to 60 degrees and drawn along it, on each device", true, false,
       obliqueBone},
      {"tool_gestures", "random gestures with a hand, at the end of a mounted tool", true, false,
       toolGestures},
      {"random_energy_500981", "the random gesture of a nearly free hand that a late loop gives energy", true,
       false, randomEnergySeed},
  };
}

namespace {

Pose uprightAt(double depth_m, double aside_m = 0) {
  return {{aside_m, 0, -depth_m}, orientationAlong(kInward_W)};
}

// a needle pressed with `press_N` against a spring, which the hand lets go
struct Pressed {
  double press_N = 0, spring_N_per_m = 0;
  std::string label;
  SceneSpec scene;
  HandPlan plan{Pose{}};
  double let_go_s = 0;
};

// the greatest work that the rendered force did after `from_s`, and the force then
struct GivenBack {
  double force_N = 0, work_J = 0, retreat_m = 0;
};
GivenBack givenBack(const PlantRun& run, double from_s) {
  GivenBack given;
  const auto ticks = ticksIn(run, {from_s, run.ticks.back().time_s + 1});
  if (ticks.empty()) return given;
  given.force_N = norm(ticks.front().rendered_force_N);
  for (const PlantTick& tick : ticks) {
    given.work_J = std::max(given.work_J, tick.energy_J - ticks.front().energy_J);
    given.retreat_m = std::max(given.retreat_m, tick.p_W_m.z - ticks.front().p_W_m.z);
  }
  return given;
}

}  // namespace

// A spring pressed with f holds f²/2K. Held for T and d ticks late it gives K T (½ + d) ∫v² more: for the
// quarter of a swing that empties it, (π/2)(½ + d) ωT of what it held, ω² = K/m. No model may give more than
// both.
Result<CaseOutcome> releaseUnderLoad(const CaseSettings& settings, AxialModel model,
                                     const ForceSourceFactory& source) {
  if (model == AxialModel::kFem) {
    CaseOutcome outcome;
    outcome.row.note = "as soft as its Young's modulus: what it holds is not known by formula";
    return outcome;
  }
  CaseEntry entry(settings.file, "release_under_load", settings.long_form);
  const SceneSpec both = entry.scene();
  PlantOptions plant = entry.plant();
  const double speed = entry.number("speed_m_s", 1e-3, 0.1), rest_s = entry.number("rest_s", 1e-3, 1),
               free_s = entry.number("free_s", 0.1, 10), deep_m = entry.number("tissue_depth_m", 0.001, 0.05);
  const std::vector<double> presses = entry.numbers("membrane_press_n");
  CaseTally tally("work given back over what was held", entry.number("limit", 0), entry.chatterFilter());
  if (!entry.status().ok()) return entry.status().error();

  // against the membrane the needle rests where it is as stiff as its linear term; the tissue is pressed with
  // its full cutting force
  std::vector<Pressed> all;
  for (const double press_N : presses)
    all.push_back({press_N, both.layers.front().membrane->linear_N_per_m,
                   fmt::format("membrane, {:g} N", press_N), both});
  SceneSpec tissue = both;
  tissue.layers.front().membrane.reset();
  const double cutting_N = tissue.layers.front().cutting_force_N;
  all.push_back(
      {cutting_N, tissue.tracking_wall.stiffness_N_per_m, fmt::format("tissue, {:g} N", cutting_N), tissue});

  std::string note;
  for (Pressed& one : all) {
    const bool membrane = one.scene.layers.front().membrane.has_value();
    const double depth_m = membrane ? one.press_N / one.spring_N_per_m : deep_m;
    const double aim_m = depth_m + one.press_N / plant.device.hand.stiffness_N_per_m;
    one.plan = HandPlan(uprightAt(-0.005));
    one.plan.hold(0.3).moveTo(uprightAt(aim_m), speed, Motion::kTrapezoid).hold(rest_s);
    one.let_go_s = one.plan.duration_s();
    one.plan.hold(free_s);
    plant.device.hand.let_go_s = one.let_go_s;
    ASSIGN_OR_RETURN(const auto run, runScene(source, likeForLike(one.scene, model), one.plan, plant));
    const GivenBack given = givenBack(run, one.let_go_s);
    const double held_J = given.force_N * given.force_N / (2 * one.spring_N_per_m);
    const double turn_per_tick =
        std::sqrt(one.spring_N_per_m / plant.device.limits.apparent_mass_kg) / plant.rate_hz;
    const double late = std::numbers::pi / 2 * (0.5 + plant.device.delay_ticks) * turn_per_tick;
    const TimeWindow free{one.let_go_s, one.plan.duration_s()};
    // nothing was held where a model let the needle through
    const double share = held_J > 0 ? given.work_J / (held_J * (1 + late)) : given.work_J > 0 ? HUGE_VAL : 0;
    tally.add(run, free, share, one.label, heldIn(run, free));
    note += fmt::format("{}{}: {:.2g} of {:.2g} mJ, back by {:.2g} mm", note.empty() ? "" : "; ", one.label,
                        1e3 * given.work_J, 1e3 * held_J, 1e3 * given.retreat_m);
  }
  CaseOutcome outcome = tally.finish();
  outcome.row.note = note;
  return outcome;
}

namespace {

// the greatest change of the rendered force in a tick that neither the needle's own way nor a declared
// release explains; the gate takes up to five ticks for a release
double renderedStep_N(const PlantRun& run, TimeWindow window) {
  constexpr int kReleaseTicks = 5;
  double most_N = 0;
  int released = 0;
  const PlantTick* before = nullptr;
  for (const PlantTick& tick : ticksIn(run, window)) {
    released = (tick.report.flags & kDeclaredReleases) != 0 ? kReleaseTicks : released - 1;
    if (before != nullptr && released <= 0)
      most_N =
          std::max(most_N, norm(tick.rendered_force_N - before->rendered_force_N) -
                               run.axial_stiffness_N_per_m * norm(tick.seen.p_WT_m - before->seen.p_WT_m));
    before = &tick;
  }
  return most_N;
}

// the greatest RMS of the rendered force over any 10 s
double greatestRms_N(const PlantRun& run) {
  const auto window = static_cast<std::size_t>(10 * run.rate_hz);
  double sum = 0, most = 0;
  for (std::size_t k = 0; k < run.ticks.size(); ++k) {
    sum += normSquared(run.ticks[k].rendered_force_N);
    if (k >= window) sum -= normSquared(run.ticks[k - window].rendered_force_N);
    most = std::max(most, sum);
  }
  return std::sqrt(most / static_cast<double>(window));
}

}  // namespace

// The gate lowers the force smoothly, and lets its share rise only where next to nothing is wanted.
Result<CaseOutcome> deratedRelease(const CaseSettings& settings, AxialModel model,
                                   const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "derated_release", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  PlantOptions plant = entry.plant();
  const TimedPlan path = entry.path();
  const TimeWindow loaded = entry.window(path, "loaded"), free = entry.window(path, "free");
  CaseTally tally("greatest step of the rendered force beyond the springs [N]", entry.number("limit", 0),
                  entry.chatterFilter());
  if (!entry.status().ok()) return entry.status().error();

  plant.device.hand.let_go_s = free.from_s;
  ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, plant));
  double wanted_N = 0, least_share = 1;
  for (const PlantTick& tick : ticksIn(run, loaded))
    if ((tick.gate_flags & kGateThermalLimited) != 0) {
      const double force_N = norm(tick.report.wrench_W.force_N);
      wanted_N = std::max(wanted_N, force_N);
      least_share = std::min(least_share, norm(tick.rendered_force_N) / force_N);
    }
  if (wanted_N == 0) {
    CaseOutcome outcome;
    outcome.row.note = "never above the continuous limit for long enough";
    return outcome;
  }
  const TimeWindow all{loaded.from_s, run.ticks.back().time_s + 1};
  tally.add(run, all, renderedStep_N(run, all), std::string(axialModelName(model)), heldIn(run, all));
  CaseOutcome outcome = tally.finish();
  const double rms_N = greatestRms_N(run), most_N = plant.device.limits.continuous_force_N;
  if (rms_N > most_N * (1 + 1e-9)) {
    if (outcome.row.passed) outcome.row.verdict = Verdict::kChatters;
    outcome.row.passed = false;
  }
  outcome.row.note = fmt::format("down to {:.2g} of {:.2g} N; RMS over 10 s {:.3g} N, {:g} N passes",
                                 least_share, wanted_N, rms_N, most_N);
  return outcome;
}

namespace {

// what is left of a push aside
struct Aside {
  double swing_N = 0;  ///< peak-to-peak of the fixture's force in the window
  double stiffness_N_per_m = 0;
  bool growing = false;
};
Aside asideIn(const PlantRun& run, TimeWindow window) {
  Aside left;
  left.growing = heldIn(run, window);
  for (const Vec3 across : {Vec3{1, 0, 0}, Vec3{0, 1, 0}}) {
    const auto force_N = forceAlong(ticksIn(run, window), across);
    left.swing_N = std::max(left.swing_N, peakToPeak(force_N));
    left.growing = left.growing || grows(force_N, 0.05);
  }
  for (const PlantTick& tick : run.ticks)
    left.stiffness_N_per_m = std::max(left.stiffness_N_per_m, tick.report.clamping_stiffness_N_per_m);
  return left;
}

}  // namespace

// The stiffness k at the tip is k·lever² about the handle. It is stable with this hand while
// k ≤ b_tip/(T (½ + d)), 1/b_tip = 1/b + lever²/b_turn (dampingAcross): the push aside must die out, but for
// what the encoders cannot tell from rest (kRestEncoderSteps), and with exact encoders altogether.
Result<CaseOutcome> leverClamping(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "lever_clamping", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const PlantOptions plant = entry.plant();
  const double depth_m = entry.number("depth_m", 0.001, 0.05), speed = entry.number("speed_m_s", 1e-3, 0.1),
               aside_m = entry.number("aside_m", 1e-4, 0.02), push_s = entry.number("push_s", 0.01, 5),
               watch_s = entry.number("watch_s", 0.5, 20), judged_s = entry.number("judged_s", 0.1, 20);
  const BandFilter band = entry.chatterFilter();
  if (!entry.status().ok()) return entry.status().error();

  HandPlan plan(uprightAt(-0.005));
  plan.hold(0.3).moveTo(uprightAt(depth_m), speed, Motion::kTrapezoid).hold(0.3);
  plan.moveIn(uprightAt(depth_m, aside_m), push_s, Motion::kMinJerk).hold(watch_s);
  const TimeWindow end{plan.duration_s() - judged_s, plan.duration_s()};
  PlantOptions exact = plant;
  exact.device.encoder_step_m = exact.device.encoder_step_rad = 0;
  ASSIGN_OR_RETURN(const auto run, runScene(source, scene, plan, plant));
  ASSIGN_OR_RETURN(const auto without, runScene(source, scene, plan, exact));
  const Aside left = asideIn(run, end), left_exact = asideIn(without, end);

  const SimulatedDeviceOptions& device = plant.device;
  const double lever_m = norm(device.X_HT.p);
  const double encoder_m = device.encoder_step_m + lever_m * device.encoder_step_rad;
  CaseTally tally("force aside, peak-to-peak in the end [N]",
                  kRestEncoderSteps * encoder_m * left.stiffness_N_per_m, band);
  tally.add(run, end, left.swing_N, std::string(axialModelName(model)), left.growing || left_exact.growing);
  CaseOutcome outcome = tally.finish();
  if (left_exact.swing_N > kNoticeableStep_N) {
    if (outcome.row.passed) outcome.row.verdict = Verdict::kChatters;
    outcome.row.passed = false;
  }
  outcome.row.note = fmt::format(
      "{:.0f} N/m at the tip are {:.2g} N·m/rad at the handle, the device holds {:g}; {:.2g} N are left, "
      "with "
      "exact encoders {:.1g} N",
      left.stiffness_N_per_m, left.stiffness_N_per_m * lever_m * lever_m,
      device.limits.max_rotational_stiffness_Nm_per_rad, left.swing_N, left_exact.swing_N);
  return outcome;
}

namespace {

// a device of the file's list, with the case's plant for all else
struct BoneDevice {
  std::string name;
  PlantOptions plant;
  double stiffness_N_per_m = 0;  ///< of the bone: as much as the device renders
};
std::vector<BoneDevice> boneDevices(CaseEntry& entry) {
  std::vector<BoneDevice> devices;
  for (const char* name : {"desktop", "desktop_with_tool", "falcon"}) {
    const std::string path = std::string("devices.") + name + ".";
    BoneDevice device{name, entry.plant(), entry.number(path + "stiffness_n_per_m", 1, 10'000)};
    DeviceLimits& limits = device.plant.device.limits;
    limits.apparent_mass_kg = entry.number(path + "mass_kg", 0.01, 10);
    limits.damping_Ns_per_m = entry.number(path + "damping_ns_per_m", 0, 100);
    limits.peak_force_N = entry.number(path + "peak_force_n", 0.1, 100);
    limits.continuous_force_N = entry.number(path + "continuous_force_n", 0.1, 100);
    device.plant.device.X_HT.p.z = entry.number(path + "tool_z_m", 0, 0.5);
    devices.push_back(device);
  }
  return devices;
}

// the greatest swing of the force in any direction of W
double swingIn(const PlantRun& run, TimeWindow window, bool& growing) {
  double most_N = 0;
  for (const Vec3 direction : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
    const auto force_N = forceAlong(ticksIn(run, window), direction);
    most_N = std::max(most_N, peakToPeak(force_N));
    growing = growing || grows(force_N, 0.05);
  }
  return most_N;
}

// a needle that slants by `angle_rad` comes to `depth_m`, presses on by `beyond_m` along its axis, and is
// drawn aside
struct BonePath {
  HandPlan plan{Pose{}};
  TimeWindow pressed, drawn;
};
BonePath pathOntoBone(CaseEntry& entry, double angle_rad, double depth_m) {
  const double speed = entry.number("speed_m_s", 1e-3, 0.1), beyond_m = entry.number("beyond_m", 1e-4, 0.1),
               aside_m = entry.number("aside_m", 1e-4, 0.05), hold_s = entry.number("hold_s", 0.1, 10),
               judged_s = entry.number("judged_s", 0.05, 10);
  const Vec3 axis{std::sin(angle_rad), 0, -std::cos(angle_rad)};
  const Quat q = orientationAlong(axis);
  const double length_m = depth_m / std::cos(angle_rad);
  const Pose outside{axis * -0.005, q}, press{axis * (length_m + beyond_m), q};
  const Pose aside{press.p + Vec3{aside_m, 0, 0}, q};
  BonePath path{HandPlan(outside), {}, {}};
  path.plan.hold(0.3).moveTo(press, speed, Motion::kTrapezoid).hold(hold_s);
  path.pressed = {path.plan.duration_s() - judged_s, path.plan.duration_s()};
  path.plan.moveTo(aside, speed, Motion::kTrapezoid).hold(hold_s);
  path.drawn = {path.plan.duration_s() - judged_s, path.plan.duration_s()};
  path.plan.moveTo(outside, speed, Motion::kTrapezoid).hold(0.3);
  return path;
}

}  // namespace

// The hand's spring k and the bone's K share what the hand wants beyond the surface: along the normal the
// needle sinks by k/(k + K) of it, whether it sticks or slips, less what the tissue bears. It is stable with
// this hand while K ≤ (b + b_hand)/(T (½ + d)): the force comes to rest, but for what the encoders cannot
// tell from rest.
Result<CaseOutcome> obliqueBone(const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "oblique_bone", settings.long_form);
  SceneSpec scene = entry.scene(model);
  const double beyond_m = entry.number("beyond_m", 1e-4, 0.1), sink_share = entry.number("sink_share", 1, 2);
  const std::vector<double> angles_deg = entry.numbers("angles_deg");
  CaseTally tally("force at rest on bone, peak-to-peak, over that of four encoder steps", 1,
                  entry.chatterFilter());
  const std::vector<BoneDevice> devices = boneDevices(entry);
  if (!entry.status().ok()) return entry.status().error();

  const double top_m = scene.layers.front().thickness_m;
  double most_share = 0;
  std::string deepest;
  for (const BoneDevice& device : devices) {
    scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] = device.stiffness_N_per_m;
    const SimulatedDeviceOptions& options = device.plant.device;
    const double encoder_m = options.encoder_step_m + options.X_HT.p.z * options.encoder_step_rad;
    const double rest_N = kRestEncoderSteps * encoder_m * device.stiffness_N_per_m;
    const double hand_share =
        options.hand.stiffness_N_per_m / (options.hand.stiffness_N_per_m + device.stiffness_N_per_m);
    for (const double angle_deg : angles_deg) {
      const double angle_rad = angle_deg * std::numbers::pi / 180;
      const BonePath path = pathOntoBone(entry, angle_rad, top_m);
      if (!entry.status().ok()) return entry.status().error();
      ASSIGN_OR_RETURN(const auto run, runScene(source, scene, path.plan, device.plant));
      const std::string label = fmt::format("{}, {:g} degrees", device.name, angle_deg);
      for (const TimeWindow window : {path.pressed, path.drawn}) {
        bool growing = heldIn(run, window);
        const double swing_N = swingIn(run, window, growing);
        tally.add(run, window, swing_N / rest_N, label, growing);
      }
      const double sinks_m = beyond_m * std::cos(angle_rad) * hand_share;
      for (const PlantTick& tick : run.ticks) {
        const double share = (-tick.p_W_m.z - top_m) / sinks_m;
        if (share <= most_share) continue;
        most_share = share;
        deepest = label;
      }
    }
  }
  CaseOutcome outcome = tally.finish();
  if (most_share > sink_share) {
    if (outcome.row.passed) outcome.row.verdict = Verdict::kChatters;
    outcome.row.passed = false;
  }
  outcome.row.note = fmt::format("sinks by {:.3g} of what bone and hand share ({}), {:g} passes", most_share,
                                 deepest, sink_share);
  return outcome;
}

}  // namespace needlelab
