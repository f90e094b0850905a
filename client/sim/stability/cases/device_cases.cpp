/// Errors of a device or its clock that the gate cannot see: a jump just below its limit, a frozen axis, the
/// other quaternion of the same rotation; and a clock that steps, which the gate must bridge.

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/haptics/geometry.h"

namespace needlelab {
namespace {

// The engine believes the position: the wall follows it and stays where the glitch moved it. So the force
// differs by at most what tissue can exert, f_cut + f_att, until the needle has caught up with the wall.
Status glitchUnderGate(Trial& t) {
  const double glitch_m = t.number("glitch_m", 0, 0.05), speed = t.number("speed_m_s", 1e-3, 1),
               depth_m = t.number("depth_m", 0.005, 0.04), rest_s = t.number("rest_s", 0.1, 10);
  DeviceScript script;
  std::vector<std::size_t> ticks;  // on the way in, at rest, on the way out
  script.rest(0.3).goTo(depth_m, speed);
  ticks.push_back(script.ticks());
  script.goTo(depth_m + 0.005, speed).rest(rest_s);
  ticks.push_back(script.ticks());
  script.rest(0.2).goTo(depth_m, speed);
  ticks.push_back(script.ticks());
  script.goTo(-0.005, speed);
  ASSIGN_OR_RETURN(const auto sound, t.gated(script.samples()));

  double departure_N = 0;
  std::size_t longest_felt = 0;  // in ticks
  for (const std::size_t tick : ticks)
    for (const Vec3 aside : {Vec3{0, 0, -glitch_m}, Vec3{0, 0, glitch_m}, Vec3{glitch_m, 0, 0}}) {
      auto samples = script.samples();
      samples[tick].tip.p_WT_m += aside;
      ASSIGN_OR_RETURN(const auto disturbed, t.gated(samples));
      std::size_t felt = 0;
      for (std::size_t k = tick; k < disturbed.size(); ++k) {
        const double off_N = norm(disturbed[k].out_W.force_N - sound[k].out_W.force_N);
        departure_N = disturbed[k].fault != Fault::kNone ? HUGE_VAL : std::max(departure_N, off_N);
        felt += off_N > kNoticeableStep_N ? 1 : 0;
      }
      longest_felt = std::max(longest_felt, felt);
    }
  const LayerSpec& layer = t.wall.layers.front();
  t.judge("greatest departure from the run without it [N]", departure_N,
          layer.cutting_force_N + layer.attracted_force_N,
          fmt::format("noticeable for up to {:.2g} s", static_cast<double>(longest_felt) / kMotionRate_hz));
  return {};
}

constexpr double kGateWait_s = 0.02;  // how long the gate may hold the force after a jump

// In, aside and deeper, back, out; the strokes during which an axis freezes.
struct AsidePlan {
  HandPlan plan{Pose{}};
  std::array<double, 2> stroke_s{};
};
AsidePlan asidePlan(double depth_m, double aside_m, double deeper_m, double speed_mps) {
  AsidePlan of;
  of.plan = HandPlan(upright(-0.005));
  of.plan.hold(0.3).moveTo(upright(depth_m), speed_mps, Motion::kLinear);
  of.stroke_s[0] = of.plan.duration_s();
  of.plan.moveTo(upright(depth_m + deeper_m, aside_m), speed_mps, Motion::kLinear).hold(0.3);
  of.stroke_s[1] = of.plan.duration_s();
  of.plan.moveTo(upright(depth_m), speed_mps, Motion::kLinear)
      .moveTo(upright(-0.005), speed_mps, Motion::kLinear);
  return of;
}

std::vector<DeviceSample> deviceSamples(const HandPlan& plan) {
  std::vector<DeviceSample> samples;
  for (const TipSample& tip : samplesOf(plan, kMotionRate_hz)) samples.emplace_back().tip = tip;
  return samples;
}

// The force belongs to the position that the device reports. When the axis moves again, the position jumps
// and the gate bridges the jump; then the force must equal that of a device that never froze. Along the
// needle it does not depend on the path; the fixture's dead radius does, by at most k·|e|.
Status frozenAxis(Trial& t) {
  const double depth_m = t.number("depth_m", 0.001, 0.03), aside_m = t.number("aside_m", 0, 0.02),
               deeper_m = t.number("deeper_m", 0.001, 0.03), speed = t.number("speed_m_s", 1e-3, 0.1),
               frozen_s = t.number("frozen_s", 0.01, 1), limit = t.number("limit", 0);
  const AsidePlan plan = asidePlan(depth_m, aside_m, deeper_m, speed);
  const auto truth = deviceSamples(plan.plan);
  ASSIGN_OR_RETURN(const auto sound, t.gated(truth));

  double departure_N = 0, given_J = 0;
  bool fault = false;
  for (double Vec3::*axis : {&Vec3::x, &Vec3::y, &Vec3::z})
    for (const double stroke_s : plan.stroke_s) {
      const auto from = static_cast<std::size_t>(stroke_s * kMotionRate_hz + 0.5);
      const auto to = from + static_cast<std::size_t>(frozen_s * kMotionRate_hz + 0.5);
      auto samples = truth;
      for (std::size_t k = from; k < to; ++k) samples[k].tip.p_WT_m.*axis = truth[from].tip.p_WT_m.*axis;
      ASSIGN_OR_RETURN(const auto frozen, t.gated(samples));
      double work_J = 0;
      for (std::size_t k = from; k < to; ++k) {
        work_J += dot(frozen[k - 1].out_W.force_N, truth[k].tip.p_WT_m - truth[k - 1].tip.p_WT_m);
        given_J = std::max(given_J, work_J);
      }
      for (std::size_t k = to; k < frozen.size(); ++k) {
        fault = fault || frozen[k].fault != Fault::kNone;
        if (k < to + static_cast<std::size_t>(kGateWait_s * kMotionRate_hz)) continue;
        // the needle is upright: the fixture's force is perpendicular to W's z
        const Vec3 by_N = frozen[k].out_W.force_N - sound[k].out_W.force_N;
        const StepReport& at = sound[k].report;
        const double radius_N = at.clamping_stiffness_N_per_m * at.lateral_error_m;
        departure_N = std::max({departure_N, std::abs(by_N.z), norm({by_N.x, by_N.y, 0}) - radius_N});
      }
    }
  t.row().energy_J = given_J;
  // while an axis is frozen the force cannot follow the hand's motion: at most the tissue's own force over
  // that distance
  const LayerSpec& layer = t.wall.layers.front();
  const double max_J = (layer.cutting_force_N + layer.attracted_force_N) * speed * frozen_s;
  t.judge(
      "departure, 20 ms after the axis froze [N]", fault ? HUGE_VAL : departure_N, limit,
      fmt::format("a frozen axis gives the hand {:.2g} mJ, {:.2g} mJ passes", 1e3 * given_J, 1e3 * max_J));
  t.require(given_J <= max_J);
  return {};
}

// The handle behind the gate, with a tool, as in HapticChain.
Result<std::vector<Wrench>> runAtHandle(const ForceSourceFactory& make_source, const SceneSpec& scene,
                                        const std::vector<Pose>& handles, const Pose& X_HT, double rate_hz) {
  ASSIGN_OR_RETURN(auto source, make_source(scene, rate_hz));
  ForceGate gate(DeviceLimits{}, rate_hz);
  std::vector<Wrench> at_handle;
  at_handle.reserve(handles.size());
  StepReport report;
  for (const Pose& X_WH : handles) {
    const Pose X_WT = tipFromHandle(X_WH, X_HT);
    Wrench wanted;
    if (gate.admit({X_WT.p, X_WT.q}, true, 0.0)) {
      source->step({X_WT.p, normalized(X_WT.q)}, report);
      wanted = wrenchAtHandle(report.wrench_W, X_WT.p, X_WH.p);
    }
    gate.noteOutside(report.depth_m <= 0);
    at_handle.push_back(gate.guard(wanted).wrench());
  }
  return at_handle;
}

// q and −q are the same rotation, and all products of the tool's transform accept either: force and torque
// are bit-identical, however often the sign changes.
Status quaternionSign(Trial& t) {
  const Pose X_HT = t.plant.device.X_HT;
  const PassivityGesture motion = t.motion();
  RETURN_IF_ERROR(t.status());
  std::vector<Pose> handles;
  for (const TipSample& tip : samplesOf(motion))
    handles.push_back(Pose{tip.p_WT_m, tip.q_WT} * inverse(X_HT));
  const auto run = [&](const std::vector<Pose>& poses) {
    return runAtHandle(t.source, t.scene, poses, X_HT, motion.rate_hz);
  };
  ASSIGN_OR_RETURN(const auto sound, run(handles));

  CaseRow& row = t.row();
  row.max_force_N = 0;
  double departure = 0, torque_Nm = 0;
  // in every second tick, or once in the middle
  for (const bool always : {true, false}) {
    auto poses = handles;
    for (std::size_t k = 0; k < poses.size(); ++k)
      if (always ? k % 2 == 1 : k > poses.size() / 2) poses[k].q = otherSign(poses[k].q);
    ASSIGN_OR_RETURN(const auto turned, run(poses));
    for (std::size_t k = 0; k < turned.size(); ++k) {
      row.finite = row.finite && isFinite(turned[k].force_N) && isFinite(turned[k].torque_Nm);
      row.max_force_N = std::max(*row.max_force_N, norm(turned[k].force_N));
      torque_Nm = std::max(torque_Nm, norm(sound[k].torque_Nm));
      departure = std::max({departure, norm(turned[k].force_N - sound[k].force_N),
                            norm(turned[k].torque_Nm - sound[k].torque_Nm)});
    }
  }
  t.judge("greatest departure from the run with one sign [N, N·m]", departure, t.number("limit", 0),
          fmt::format("torque at the handle up to {:.2g} N·m", torque_Nm));
  // without torque the sign of the torque is not tested
  t.require(torque_Nm > 0);
  return {};
}

}  // namespace

std::vector<StabilityCase> deviceCases() {
  return {
      {"glitch_under_gate", glitchUnderGate},
      {"frozen_axis", frozenAxis},
      {"quaternion_sign", quaternionSign},
  };
}

}  // namespace needlelab
