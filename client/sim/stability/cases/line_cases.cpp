/// The line of an insertion and what guides the needle along it: its true length, the fixture, changes of
/// trajectory, the hub and the far side; and the force limits that the fixture reaches. Each expected value
/// comes from a formula on paper, for one layer with k = λ d or a straight path.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "client/device/hand/hand.h"
#include "client/sim/stability/case.h"
#include "common/base/units.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/geometry.h"

namespace needlelab {
namespace {

constexpr double kPi = std::numbers::pi;

// A needle that points down and slants toward +x; neighbouring angles have neighbouring quaternions.
Quat slanting(double angle_rad) {
  return {0, std::cos(angle_rad / 2), 0, std::sin(angle_rad / 2)};
}
Vec3 axisAt(double angle_rad) {
  return zAxis(slanting(angle_rad));
}
// Below W's origin, which lies on the skin.
Vec3 below(double deep_m, double aside_m = 0) {
  return {aside_m, 0, -deep_m};
}

// A plan of straight moves at one speed.
struct Way {
  double speed_mps, rate_hz;
  HandPlan plan;

  Way& to(Vec3 p, double angle_rad = 0) {
    return plan.moveTo({p, slanting(angle_rad)}, speed_mps, Motion::kLinear), *this;
  }
  Way& turnTo(Vec3 p, double angle_rad, double seconds) {
    return plan.moveIn({p, slanting(angle_rad)}, seconds, Motion::kLinear), *this;
  }
  Way& rest(double seconds) { return plan.hold(seconds), *this; }
  [[nodiscard]] std::size_t endTick() const {
    return static_cast<std::size_t>(std::floor(plan.duration_s() * rate_hz + 0.5));
  }
  [[nodiscard]] std::vector<TipSample> samples() const { return samplesOf(plan, rate_hz); }
};

// Through W's origin along the axis.
Way straight(Trial& t, double way_m, double angle_rad = 0, double rate_hz = kMotionRate_hz) {
  const double speed = t.number("speed_m_s", 1e-3, 1);
  Way way{speed, rate_hz, HandPlan({axisAt(angle_rad) * -0.005, slanting(angle_rad)})};
  return way.to(axisAt(angle_rad) * way_m, angle_rad);
}
double length(Trial& t, const std::string& field) {
  return t.number(field, -0.5, 0.5);
}
Result<MotionRun> move(Trial& t, const Way& way) {
  return t.move(way.samples(), way.rate_hz);
}
void judge(Trial& t, std::string quantity, double measured, std::string note) {
  t.judge(std::move(quantity), measured, t.number("limit", 0), std::move(note));
}

double lambdaOf(const SceneSpec& scene) {
  return scene.layers.empty() ? 0 : scene.layers.front().lateral_stiffness_N_per_m2;
}
double acrossOf(const StepReport& report) {
  return report.clamping_stiffness_N_per_m * report.lateral_error_m;
}

// β of "Change of trajectory": how far about the hole u holds a needle
double turnAngle(const SceneSpec& scene, double length_m) {
  const double share = length_m / scene.needle_length_m;
  return std::atan(std::min(1.0, 1e-4 + share * share));
}

// Held aside for 10 s with encoder steps or tremor. U = ½ λ |p| e²: eq. 8 across, and ½ λ e² against p.
Status heldFixture(Trial& c) {
  const Vec3 held = below(length(c, "depth_m"), length(c, "aside_m"));
  const double hold_s = c.number("hold_s", 0.1, 100), tremor_m = c.number("tremor_m", 0, 1e-3),
               tremor_radps = 2 * kPi * c.number("tremor_hz", 1, 50);
  const auto steps = c.numbers("encoder_steps_m"), strokes = c.numbers("strokes_m");
  const Vec3 right_N = Vec3{-lambdaOf(c.scene) * norm(held) * held.x, 0, 0} -
                       normalized(held) * (0.5 * lambdaOf(c.scene) * held.x * held.x);
  double most = 0;
  for (const double rate_hz : c.numbers("rates_hz")) {
    Way way = straight(c, -held.z, 0, rate_hz);
    way.to(held);
    for (const double stroke_m : strokes) way.to(below(stroke_m, held.x)).to(held);
    for (std::size_t kind = 0; kind <= steps.size(); ++kind) {  // the last one is the tremor
      auto samples = way.samples();
      HandRandom random(kind);
      const TipSample still{held, slanting(0)};
      for (int k = 0; k < hold_s * rate_hz; ++k)
        samples.emplace_back(still).p_WT_m.z += kind == steps.size()
                                                    ? tremor_m * std::sin(tremor_radps * k / rate_hz)
                                                    : steps[kind] * static_cast<double>(random.next() % 2);
      samples.push_back(still);
      ASSIGN_OR_RETURN(const auto run, c.move(samples, rate_hz));
      most = std::max(most, norm(run.ticks.back().report.wrench_W.force_N - right_N) / norm(right_N));
    }
  }
  judge(c, "departure from eq. 8 and its push, over the force", most,
        fmt::format("eq. 8 and its push: {:.3g} N", norm(right_N)));
  return {};
}

// Moves across its own axis to the target. Down to 0.6 mm the tip is ahead of P0, by that depth times tan +
// 1/tan of the slant: no other length may be missing. u turns by at most 45°, and not within β, so k|e| is at
// least λ d² sin of the remaining angle.
Status crosswise(Trial& c) {
  const double slant = radOf(c.number("slant_deg", 10, 80)), off = radOf(c.number("off_deg", 0, 5));
  const double way_m = length(c, "depth_m") / std::cos(slant), tilt = kPi / 2 - slant + off;
  const double led_m = length(c, "led_m") * (std::tan(slant) + 1 / std::tan(slant));
  Way way{c.number("speed_m_s", 1e-3, 1), kMotionRate_hz,
          HandPlan({axisAt(-slant) * -0.005, slanting(tilt)})};
  ASSIGN_OR_RETURN(const auto run, move(c, way.to(axisAt(-slant) * way_m, tilt).rest(0.5)));
  const StepReport& last = run.ticks.back().report;
  const double min_m = way_m - led_m;
  const double held = std::min(turnAngle(c.scene, min_m), kPi / 4 - std::asin(led_m / way_m));
  const double min_N = lambdaOf(c.scene) * min_m * min_m * std::sin(held);
  c.judge("inserted length that is missing [m]", std::abs(last.insertion_m - way_m), led_m,
          fmt::format("{:.3g} N at the target, {:.3g} N at least", acrossOf(last), min_N));
  c.require(acrossOf(last) >= min_N, "eq. 8");
  return {};
}

double frictionAt_N_per_m(const SceneSpec& scene, double depth_m) {
  std::size_t i = 0;
  while (i + 1 < scene.layers.size() && depth_m >= scene.layers[i].thickness_m)
    depth_m -= scene.layers[i++].thickness_m;
  return scene.layers[i].friction_N_per_m;
}

// Straight in. P0 is the point of entry, and shaft friction is that of the layers along the path.
Status roundLimbLength(Trial& c) {
  const double max_m = length(c, "most_m"), chord = c.number("chord_share", 0.1, 0.95);
  const auto angles = c.numbers("angles_deg");
  std::vector<std::pair<Limb, double>> limbs = {{c.scene.limb, HUGE_VAL}};
  for (const double r : c.numbers("radii_m")) {
    limbs.emplace_back(SphereLimb{{0, 0, -r}, r}, r);
    limbs.emplace_back(CapsuleLimb{{0, -0.1, -r}, {0, 0.1, -r}, r}, r);
  }
  double worst_m = 0, worst_share = 0;
  bool falls = false;
  for (const auto& [limb, radius_m] : limbs)
    for (const double angle_deg : angles) {
      const double angle = radOf(angle_deg);
      c.scene.limb = limb;
      ASSIGN_OR_RETURN(const auto run,
                       move(c, straight(c, std::min(max_m, chord * 2 * radius_m * std::cos(angle)), angle)));
      double friction_N = 0, before_m = 0, reported_m = 0;
      for (const MotionTick& tick : run.ticks) {
        if (!(tick.report.depth_m > 0)) continue;
        const double way_m = norm(tick.tip.p_WT_m);
        friction_N += frictionAt_N_per_m(c.scene, tick.report.depth_m) * (way_m - before_m);
        worst_m = std::max(worst_m, std::abs(tick.report.insertion_m - way_m));
        falls = falls || tick.report.insertion_m < reported_m;
        reported_m = tick.report.insertion_m;
        before_m = way_m;
      }
      worst_share = std::max(worst_share, std::abs(-run.ticks.back().report.friction_N / friction_N - 1));
    }
  judge(c, "inserted length off the way in the limb [m]", worst_m,
        fmt::format("friction off that of the layers on the way by {:.2g} %", 100 * worst_share));
  c.require(worst_share <= c.number("friction_share", 0, 1), "the layers' friction");
  c.require(!falls, "the length never falls");
  return {};
}

// The angle to u in the last tick before it turns, for a needle at this depth that swings about its hole;
// infinite if u never turns.
Result<double> turnsAt(Trial& c, double length_m) {
  constexpr double kStep_rad = 2e-4, kMax_rad = 1.2;
  auto samples = straight(c, length_m).samples();
  const std::size_t swings = samples.size();
  for (double angle = 0; angle < kMax_rad; angle += kStep_rad)
    samples.push_back({axisAt(angle) * length_m, slanting(angle)});
  ASSIGN_OR_RETURN(const auto run, c.move(samples));
  for (std::size_t k = swings; k < run.ticks.size(); ++k)
    if ((run.ticks[k].report.flags & kFlagTurn) != 0)
      return std::asin(run.ticks[k - 1].report.lateral_error_m / length_m);
  return HUGE_VAL;
}

// Near the skin the trajectory follows the hand: about the hole, and after a withdrawal about the tip.
// Deeper, it is held up to the angle from the page, which rises with the length.
Status reAim(Trial& c) {
  const double length_m = length(c, "length_m"), deeper_m = length(c, "deeper_m"),
               aim = radOf(c.number("aim_deg", 1, 45)), turn_s = c.number("turn_s", 0.1, 10),
               off = radOf(c.number("turning_off_deg", 0));
  std::vector<std::pair<Way, std::size_t>> ways;
  const auto goOn = [&](const Way& before, Vec3 turns_at, Vec3 ends_at) {
    Way way = before;
    ways.emplace_back(way.turnTo(turns_at, aim, turn_s).to(ends_at, aim), before.endTick());
  };
  goOn(straight(c, length_m), axisAt(aim) * length_m, axisAt(aim) * (length_m + deeper_m));
  for (const double left_m : c.numbers("withdrawals_m"))
    goOn(straight(c, deeper_m).to(below(left_m)), below(left_m), below(left_m) + axisAt(aim) * deeper_m);
  double max_N = 0;
  for (const auto& [way, from] : ways) {
    ASSIGN_OR_RETURN(const auto run, move(c, way));
    for (std::size_t k = from; k < run.ticks.size(); ++k)
      max_N = std::max(max_N, run.ticks[k].report.clamping_N);
  }
  double worst = 0, last = 0;
  for (const double one_m : c.numbers("lengths_m")) {
    ASSIGN_OR_RETURN(last, turnsAt(c, one_m));
    worst = std::max(worst, std::abs(last - turnAngle(c.scene, one_m)));
  }
  judge(c, "clamping that a re-aim near the skin meets [N]", max_N,
        fmt::format("u turns within {:.2g}° of the page's angle, deepest at {:.3g}°", worst * 180 / kPi,
                    last * 180 / kPi));
  c.require(worst <= off, "the page's angle");
  return {};
}

// Pushed aside just below the skin, then straight in: eq. 8 about the line from where the skin has held P0,
// which is 0.05 mm and three times the tip's depth below 0.6 mm away ("Near the skin").
Status asideThenDeep(Trial& c) {
  const double shallow_m = length(c, "shallow_m"), deep_m = length(c, "deep_m");
  double most = 0, right_N = 0;
  for (const double aside_m : c.numbers("asides_m")) {
    Way way = straight(c, shallow_m);
    way.to(below(shallow_m, aside_m)).to(below(deep_m, aside_m)).rest(0.1);
    ASSIGN_OR_RETURN(const auto run, move(c, way));
    const double off_m = std::min(aside_m, 0.05e-3 + 3 * (shallow_m - 0.6e-3));
    right_N = std::min(c.scene.virtual_fixture.max_force_N,
                       run.ticks.back().report.clamping_stiffness_N_per_m * off_m);
    most = std::max(most, std::abs(run.ticks.back().report.clamping_N / right_N - 1));
  }
  judge(c, "departure from eq. 8", most, fmt::format("{:.3g} N after the furthest way aside", right_N));
  return {};
}

// Through a finger up to the hub, aside beyond it, and back: friction and k are those of the chord.
Status runThrough(Trial& c) {
  const double chord_m = length(c, "chord_m"), deep_m = length(c, "deep_m"), aside_m = length(c, "aside_m"),
               length_off_m = length(c, "length_off_m"), share = c.number("share", 0, 1);
  Way way = straight(c, deep_m);
  const std::size_t through = way.endTick(), aside = way.to(below(deep_m, aside_m)).rest(0.1).endTick();
  ASSIGN_OR_RETURN(const auto run, move(c, way.to(below(deep_m)).to(below(-0.005))));
  const double hub_N_per_m = c.scene.stage_numbers[stageOf(Effect::kHub)][kHubStiffness_N_per_m];
  double length_m = 0, hub_N = 0;
  for (const auto& [tip, report, slant] : run.ticks) {
    const double way_m = tip.p_WT_m.z < 0 ? norm(tip.p_WT_m) : 0;
    length_m = std::max(length_m, std::abs(report.insertion_m - way_m));
    const double right_N = hub_N_per_m * std::max(0.0, way_m - c.scene.needle_length_m);
    hub_N = std::max(hub_N, std::abs(report.hub_N - right_N));
  }
  const PassivityRecord record = observed(run);
  const double friction_N = -run.ticks[through].report.friction_N,
               across_N = acrossOf(run.ticks[aside].report);
  const auto isNear = [share](double is, double right) { return std::abs(is - right) <= share * right; };
  judge(
      c, "greatest force step beyond the springs [N]", record.worst_step_N,
      fmt::format("length off by {:.2g} m, hub by {:.2g} N; friction {:.3g} N, aside {:.3g} N; insertions {}",
                  length_m, hub_N, friction_N, across_N, record.insertions));
  c.require(length_m <= length_off_m, "the way in");
  c.require(hub_N <= hub_N_per_m * length_off_m, "the hub's force");
  c.require(isNear(friction_N, c.scene.layers.front().friction_N_per_m * chord_m), "the chord's friction");
  c.require(isNear(across_N, lambdaOf(c.scene) * chord_m * aside_m), "eq. 8");
  c.require(record.insertions == 1, "one insertion");
  return {};
}

// The largest energy that one of the moves between `ends` gives to the hand.
double mostGain_J(const std::vector<TipSample>& places, const std::vector<Wrench>& wrenches,
                  const std::vector<std::size_t>& ends) {
  double max_J = -HUGE_VAL;
  for (std::size_t i = 1; i < ends.size(); ++i) {
    double work_J = 0;
    for (std::size_t k = ends[i - 1] + 1; k <= ends[i]; ++k)
      work_J += workBetween(places[k - 1], wrenches[k - 1], places[k], wrenches[k]);
    max_J = std::max(max_J, work_J);
  }
  return max_J;
}

// Pressed in, aside, drawn back, home, in again; or in the reverse order.
Result<double> loopGain_J(Trial& c, double draw_m, bool aside_first) {
  const double deep_m = length(c, "depth_m"), aside_m = length(c, "aside_m"), back_m = deep_m - draw_m;
  const Vec3 one = below(deep_m, aside_m), other = below(back_m);
  Way way = straight(c, deep_m);
  std::vector<std::size_t> ends = {way.endTick()};
  for (std::uint64_t loop = c.whole("loops", 1); loop > 0; --loop) {
    way.to(aside_first ? one : other)
        .to(below(back_m, aside_m))
        .to(aside_first ? other : one)
        .to(below(deep_m));
    ends.push_back(way.endTick());
  }
  const auto samples = way.samples();
  ASSIGN_OR_RETURN(const auto run, c.move(samples));
  std::vector<Wrench> wrenches;
  for (const MotionTick& tick : run.ticks) wrenches.push_back(tick.report.wrench_W);
  return mostGain_J(samples, wrenches, ends);
}

// FORCE_MODEL.md ("Sum and cap") gives the cost of a cap that is reached.
Status capOnSum(Trial& c) {
  Trial capped = c;  // not in the row
  capped.scene.max_force_N = c.number("cap_n", 0.1, 50);
  double max_J = -HUGE_VAL, capped_J = -HUGE_VAL;
  for (const EffectMask effects : {c.scene.effects, bitOf(Effect::kClamping)})
    for (const double draw_m : c.numbers("draws_m"))
      for (const bool aside_first : {true, false}) {
        c.scene.effects = capped.scene.effects = effects;
        ASSIGN_OR_RETURN(const double free_J, loopGain_J(c, draw_m, aside_first));
        ASSIGN_OR_RETURN(const double bound_J, loopGain_J(capped, draw_m, aside_first));
        max_J = std::max(max_J, free_J);
        capped_J = std::max(capped_J, bound_J);
      }
  judge(c, "energy given to the hand in a loop, no cap met [J]", max_J,
        fmt::format("with a cap of {:g} N: {:.3g} mJ", capped.scene.max_force_N, 1e3 * capped_J));
  c.require(capped_J <= c.number("capped_limit_j", 0), "what the page says of the cap");
  return {};
}

// Two needles 1/50° apart, pushed along their axes: the same path in, and the same force.
Status eightyDegrees(Trial& c) {
  std::vector<double> lengths_m = {length(c, "way_m")}, forces_N;
  for (const double angle_deg : c.numbers("angles_deg")) {
    ASSIGN_OR_RETURN(const auto run, move(c, straight(c, lengths_m.front(), radOf(angle_deg))));
    lengths_m.push_back(run.ticks.back().report.insertion_m);
    forces_N.push_back(norm(run.ticks.back().report.wrench_W.force_N));
  }
  const auto apart = [](const std::vector<double>& values) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    return (*most - *least) / *most;
  };
  judge(c, "difference of length or force, over the greater", std::max(apart(lengths_m), apart(forces_N)),
        fmt::format("{:.4g} mm in, {:.3g} N", 1e3 * lengths_m.back(), forces_N.back()));
  return {};
}

WrenchLimiter gateLimiter(double rate_hz) {
  return [gate = ForceGate(DeviceLimits{}, rate_hz)](const TipSample& tip, const Wrench& wanted) mutable {
    gate.admit(tip, true, 0);
    return gate.guard(wanted).wrench();
  };
}

// A cycle: turn the handle so that the tip goes aside; wait; move the handle after the tip; stand up.
Status leaningOnTool(Trial& c) {
  const WrenchLimiterFactory& limiter = c.settings.control.limiter;
  const double lever_m = c.number("lever_m", 0.01, 0.5), aside_m = c.number("aside_m", 1e-3, 0.03),
               leg_s = c.number("leg_s", 0.05, 5);
  const Vec3 home = below(length(c, "depth_m") - lever_m);  // of the handle
  const std::uint64_t cycles = c.whole("cycles", 1);
  double max_J = -HUGE_VAL, min_share = 1;
  for (const double hold_s : c.numbers("holds_s")) {
    Way way{c.number("speed_m_s", 1e-3, 1), kMotionRate_hz, HandPlan({below(-0.005 - lever_m), slanting(0)})};
    way.rest(0.5).to(home);  // the gate fades in
    std::vector<std::size_t> ends = {way.endTick()};
    for (std::uint64_t cycle = 0; cycle < cycles; ++cycle) {
      const double turn = std::asin(aside_m / lever_m);
      way.turnTo(home, turn, leg_s).rest(hold_s).turnTo(home - below(0, aside_m), turn, leg_s);
      ends.push_back(way.turnTo(home, 0, leg_s).endTick());
    }
    const auto handles = way.samples();
    std::vector<TipSample> tips;
    for (const auto& [p_WH_m, q_WH] : handles) tips.push_back({p_WH_m + zAxis(q_WH) * lever_m, q_WH});
    ASSIGN_OR_RETURN(const auto run, c.move(tips));
    auto limited = limiter ? limiter(kMotionRate_hz) : gateLimiter(kMotionRate_hz);
    std::vector<Wrench> wrenches;
    for (std::size_t k = 0; k < tips.size(); ++k) {
      const Wrench wanted = wrenchAtHandle(run.ticks[k].report.wrench_W, tips[k].p_WT_m, handles[k].p_WT_m);
      wrenches.push_back(limited(tips[k], wanted));
      if (norm(wanted.torque_Nm) > 0.1)
        min_share = std::min(min_share, norm(wrenches.back().torque_Nm) / norm(wanted.torque_Nm));
    }
    max_J = std::max(max_J, mostGain_J(handles, wrenches, ends));
  }
  judge(c, "energy given to the hand in a cycle [J]", max_J,
        fmt::format("the torque falls to {:.2g} of the wanted value", min_share));
  c.require(min_share < 0.9, "a limit was met");
  return {};
}

}  // namespace

std::vector<StabilityCase> lineCases() {
  return {
      {"held_fixture", heldFixture, false},          {"crosswise", crosswise, false},
      {"round_limb_length", roundLimbLength, false}, {"re_aim", reAim, false},
      {"aside_then_deep", asideThenDeep, false},     {"run_through", runThrough, false},
      {"leaning_on_tool", leaningOnTool, false},     {"cap_on_sum", capOnSum, false},
      {"eighty_degrees", eightyDegrees, false},
  };
}

}  // namespace needlelab
