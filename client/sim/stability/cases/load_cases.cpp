/// Closed-loop cases of a load: a hand that lets go under it, motors too hot for it, a fixture at the end of
/// the tool's lever, and bone under a slanting needle.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/scan_nudge.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/base/units.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {
namespace {

// A needle pressed with `press_N` against a spring and then released by the hand.
struct Pressed {
  double press_N = 0, spring_N_per_m = 0, depth_m = 0;
  std::string label;
  SceneSpec scene;
};

// The largest work done by the rendered force after `from_s`, and the force at that time.
struct EnergyReturn {
  double force_N = 0, work_J = 0, retreat_m = 0;
};
EnergyReturn energyReturn(const PlantRun& run, double from_s) {
  EnergyReturn given;
  const auto ticks = ticksIn(run, {from_s, run.ticks.back().time_s + 1});
  if (ticks.empty()) return given;
  given.force_N = norm(ticks.front().rendered_force_N);
  for (const PlantTick& tick : ticks) {
    given.work_J = std::max(given.work_J, tick.energy_J - ticks.front().energy_J);
    given.retreat_m = std::max(given.retreat_m, tick.p_W_m.z - ticks.front().p_W_m.z);
  }
  return given;
}

// A spring pressed with f holds f²/2K. Held for T and d ticks late, it gives K T (½ + d) ∫v² more: for the
// quarter swing that empties it, (π/2)(½ + d) ωT of what it held, ω² = K/m. No model may give more than both
// together.
Status releaseUnderLoad(Trial& t) {
  if (t.model == AxialModel::kFem)
    return t.notApplicable("as soft as its Young's modulus: what it holds is not known by formula");
  const SceneSpec& both = t.wall;
  PlantOptions& plant = t.plant;
  const double speed = t.number("speed_m_s", 1e-3, 0.1), rest_s = t.number("rest_s", 1e-3, 1),
               free_s = t.number("free_s", 0.1, 10), deep_m = t.number("tissue_depth_m", 0.001, 0.05);
  const std::vector<double> presses = t.numbers("membrane_press_n");
  t.judges("work given back over what was held", t.number("limit", 0));
  RETURN_IF_ERROR(t.status());

  // against the membrane the needle rests where it is as stiff as its linear term; the tissue is pressed with
  // its full cutting force
  const double membrane_N_per_m = both.layers.front().membrane->linear_N_per_m;
  std::vector<Pressed> all;
  for (const double press_N : presses)
    all.push_back({press_N, membrane_N_per_m, press_N / membrane_N_per_m,
                   fmt::format("membrane, {:g} N", press_N), both});
  SceneSpec tissue = both;
  tissue.layers.front().membrane.reset();
  const double cutting_N = tissue.layers.front().cutting_force_N;
  all.push_back({cutting_N, tissue.tracking_wall.stiffness_N_per_m, deep_m,
                 fmt::format("tissue, {:g} N", cutting_N), tissue});

  for (const Pressed& one : all) {
    const double aim_m = one.depth_m + one.press_N / plant.device.hand.stiffness_N_per_m;
    HandPlan plan(upright(-0.005));
    plan.hold(0.3).moveTo(upright(aim_m), speed, Motion::kTrapezoid).hold(rest_s);
    const double release_s = plan.duration_s();
    plan.hold(free_s);
    plant.device.hand.release_s = release_s;
    t.scene = likeForLike(one.scene, t.model);
    ASSIGN_OR_RETURN(const auto run, t.loop(plan));
    const EnergyReturn given = energyReturn(run, release_s);
    const double held_J = given.force_N * given.force_N / (2 * one.spring_N_per_m);
    const double turn_per_tick =
        std::sqrt(one.spring_N_per_m / plant.device.limits.apparent_mass_kg) / plant.rate_hz;
    const double late = std::numbers::pi / 2 * (0.5 + plant.device.delay_ticks) * turn_per_tick;
    const TimeWindow free{release_s, plan.duration_s()};
    // no energy was held if a model let the needle through
    const double share = held_J > 0 ? given.work_J / (held_J * (1 + late)) : given.work_J > 0 ? HUGE_VAL : 0;
    t.add(run, free, share, heldIn(run, free));
    t.row().note +=
        fmt::format("{}{}: {:.2g} of {:.2g} mJ, back by {:.2g} mm", t.row().note.empty() ? "" : "; ",
                    one.label, 1e3 * given.work_J, 1e3 * held_J, 1e3 * given.retreat_m);
  }
  return {};
}

// The largest change of the rendered force per tick that neither the needle's own motion nor a declared
// release explains. The gate takes up to five ticks for a release.
double renderedStep_N(const PlantRun& run, TimeWindow window) {
  constexpr int kReleaseTicks = 5;
  double max_N = 0;
  int released = 0;
  const PlantTick* before = nullptr;
  for (const PlantTick& tick : ticksIn(run, window)) {
    released = (tick.report.flags & kDeclaredReleases) != 0 ? kReleaseTicks : released - 1;
    if (before != nullptr && released <= 0)
      max_N = std::max(max_N, norm(tick.rendered_force_N - before->rendered_force_N) -
                                  run.axial_stiffness_N_per_m * norm(tick.seen.p_WT_m - before->seen.p_WT_m));
    before = &tick;
  }
  return max_N;
}

// The largest RMS of the rendered force over any 10 s.
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

// The gate must lower the force smoothly, and raise its share only while almost no force is wanted.
Status deratedRelease(Trial& t) {
  const TimedPlan path = t.path();
  const TimeWindow loaded = t.window(path, "loaded"), free = t.window(path, "free");
  t.judges("greatest step of the rendered force beyond the springs [N]", t.number("limit", 0));
  t.plant.device.hand.release_s = free.from_s;
  ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
  double wanted_N = 0, min_share = 1;
  for (const PlantTick& tick : ticksIn(run, loaded))
    if ((tick.gate_flags & kGateThermalLimited) != 0) {
      const double force_N = norm(tick.report.wrench_W.force_N);
      wanted_N = std::max(wanted_N, force_N);
      min_share = std::min(min_share, norm(tick.rendered_force_N) / force_N);
    }
  if (wanted_N == 0) return t.notApplicable("never above the continuous limit for long enough");
  const TimeWindow all{loaded.from_s, run.ticks.back().time_s + 1};
  t.add(run, all, renderedStep_N(run, all), heldIn(run, all));
  const double rms_N = greatestRms_N(run), max_N = t.plant.device.limits.continuous_force_N;
  t.require(rms_N <= max_N * (1 + 1e-9));
  t.row().note = fmt::format("down to {:.2g} of {:.2g} N; RMS over 10 s {:.3g} N, {:g} N passes", min_share,
                             wanted_N, rms_N, max_N);
  return {};
}

// The largest swing of the force along one of `directions`; sets `growing` if it is held by the gate or
// grows.
double swingIn(const PlantRun& run, TimeWindow window, std::initializer_list<Vec3> directions,
               bool& growing) {
  double max_N = 0;
  growing = growing || heldIn(run, window);
  for (const Vec3 direction : directions) {
    const auto force_N = forceAlong(ticksIn(run, window), direction);
    max_N = std::max(max_N, peakToPeak(force_N));
    growing = growing || grows(force_N, 0.05);
  }
  return max_N;
}
constexpr Vec3 kX{1, 0, 0}, kY{0, 1, 0}, kZ{0, 0, 1};

// A stiffness k at the tip is k·lever² about the handle. It is stable with this hand if k ≤ b_tip/(T (½ +
// d)), 1/b_tip = 1/b + lever²/b_turn (dampingAcross): the sideways push must die out, up to what the encoders
// cannot distinguish from rest (kRestEncoderSteps), and completely with exact encoders.
Status leverClamping(Trial& t) {
  const double depth_m = t.number("depth_m", 0.001, 0.05), speed = t.number("speed_m_s", 1e-3, 0.1),
               aside_m = t.number("aside_m", 1e-4, 0.02), push_s = t.number("push_s", 0.01, 5),
               watch_s = t.number("watch_s", 0.5, 20), judged_s = t.number("judged_s", 0.1, 20);
  HandPlan plan(upright(-0.005));
  plan.hold(0.3).moveTo(upright(depth_m), speed, Motion::kTrapezoid).hold(0.3);
  plan.moveIn(upright(depth_m, aside_m), push_s, Motion::kMinJerk).hold(watch_s);
  const TimeWindow end{plan.duration_s() - judged_s, plan.duration_s()};
  const SimulatedDeviceOptions device = t.plant.device;
  ASSIGN_OR_RETURN(const auto run, t.loop(plan));
  t.plant.device.encoder_step_m = t.plant.device.encoder_step_rad = 0;
  ASSIGN_OR_RETURN(const auto exact, t.loop(plan));
  bool grows = false;
  const double left_N = swingIn(run, end, {kX, kY}, grows),
               left_exact_N = swingIn(exact, end, {kX, kY}, grows);
  double stiffness_N_per_m = 0;
  for (const PlantTick& tick : run.ticks)
    stiffness_N_per_m = std::max(stiffness_N_per_m, tick.report.clamping_stiffness_N_per_m);

  const double lever_m = norm(device.X_HT.p);
  const double encoder_m = device.encoder_step_m + lever_m * device.encoder_step_rad;
  t.judges("force aside, peak-to-peak in the end [N]", kRestEncoderSteps * encoder_m * stiffness_N_per_m);
  t.add(run, end, left_N, grows);
  t.require(left_exact_N <= kNoticeableStep_N);
  t.row().note = fmt::format(
      "{:.0f} N/m at the tip are {:.2g} N·m/rad at the handle, the device holds {:g}; {:.2g} N are left, "
      "with exact encoders {:.1g} N",
      stiffness_N_per_m, stiffness_N_per_m * lever_m * lever_m,
      device.limits.max_rotational_stiffness_Nm_per_rad, left_N, left_exact_N);
  return {};
}

// Puts a device of the file's list into the plant. Returns the bone's stiffness, the maximum that the device
// renders.
double putBoneDevice(Trial& t, const std::string& name) {
  const std::string path = "devices." + name + ".";
  DeviceLimits& limits = t.plant.device.limits;
  limits.apparent_mass_kg = t.number(path + "mass_kg", 0.01, 10);
  limits.damping_Ns_per_m = t.number(path + "damping_ns_per_m", 0, 100);
  limits.peak_force_N = t.number(path + "peak_force_n", 0.1, 100);
  limits.continuous_force_N = t.number(path + "continuous_force_n", 0.1, 100);
  t.plant.device.X_HT.p.z = t.number(path + "tool_z_m", 0, 0.5);
  return t.number(path + "stiffness_n_per_m", 1, 10'000);
}

// A needle slanted by `angle_rad` moves to `depth_m`, presses on by `beyond_m` along its axis, and is drawn
// aside.
struct BonePath {
  HandPlan plan{Pose{}};
  TimeWindow pressed, drawn;
};
BonePath pathOntoBone(Trial& t, double angle_rad, double depth_m) {
  const double speed = t.number("speed_m_s", 1e-3, 0.1), beyond_m = t.number("beyond_m", 1e-4, 0.1),
               aside_m = t.number("aside_m", 1e-4, 0.05), hold_s = t.number("hold_s", 0.1, 10),
               judged_s = t.number("judged_s", 0.05, 10);
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

// The hand's spring k and the bone's K share the hand's intended motion beyond the surface: along the normal
// the needle sinks by k/(k + K) of it, whether it sticks or slips, minus what the tissue carries. Stable with
// this hand if K ≤ (b + b_hand)/(T (½ + d)): the force comes to rest, up to what the encoders cannot
// distinguish from rest.
Status obliqueBone(Trial& t) {
  const double beyond_m = t.number("beyond_m", 1e-4, 0.1), sink_share = t.number("sink_share", 1, 2);
  const std::vector<double> angles_deg = t.numbers("angles_deg");
  t.judges("force at rest on bone, peak-to-peak, over that of four encoder steps", 1);
  RETURN_IF_ERROR(t.status());
  const double top_m = t.scene.layers.front().thickness_m;
  double max_share = 0;
  std::string deepest;
  for (const char* name : {"desktop", "desktop_with_tool", "falcon"}) {
    const double stiffness_N_per_m = putBoneDevice(t, name);
    t.scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] = stiffness_N_per_m;
    const SimulatedDeviceOptions& device = t.plant.device;
    const double encoder_m = device.encoder_step_m + device.X_HT.p.z * device.encoder_step_rad;
    const double rest_N = kRestEncoderSteps * encoder_m * stiffness_N_per_m;
    const double hand_share =
        device.hand.stiffness_N_per_m / (device.hand.stiffness_N_per_m + stiffness_N_per_m);
    for (const double angle_deg : angles_deg) {
      const double angle_rad = radOf(angle_deg);
      const BonePath path = pathOntoBone(t, angle_rad, top_m);
      ASSIGN_OR_RETURN(const auto run, t.loop(path.plan));
      for (const TimeWindow window : {path.pressed, path.drawn}) {
        bool grows = false;
        const double swing_N = swingIn(run, window, {kX, kY, kZ}, grows);
        t.add(run, window, swing_N / rest_N, grows);
      }
      const double sinks_m = beyond_m * std::cos(angle_rad) * hand_share;
      for (const PlantTick& tick : run.ticks) {
        const double share = (-tick.p_W_m.z - top_m) / sinks_m;
        if (share <= max_share) continue;
        max_share = share;
        deepest = fmt::format("{}, {:g} degrees", name, angle_deg);
      }
    }
  }
  t.require(max_share <= sink_share);
  t.row().note = fmt::format("sinks by {:.3g} of what bone and hand share ({}), {:g} passes", max_share,
                             deepest, sink_share);
  return {};
}

}  // namespace

std::vector<StabilityCase> loadCases() {
  return {
      {"release_under_load", releaseUnderLoad},
      {"derated_release", deratedRelease},
      {"lever_clamping", leverClamping},
      {"oblique_bone", obliqueBone},
  };
}

}  // namespace needlelab
