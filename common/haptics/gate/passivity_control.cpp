#include "common/haptics/gate/passivity_control.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "common/haptics/det_math.h"

namespace needlelab {
namespace {

// in addition to the delay: how long the tank lasts at the present power
constexpr double kHorizonTicks = 4;
// below this power, encoder steps decide the sign: the reduction fades in with power
constexpr double kSmallPower_W = 1e-3;
constexpr double kMinReserve_J = 1e-6;
constexpr double kShareStep = 0.1;  // greatest rise of the share in a tick
// the speed is the mean over so long, or over all kept poses: at low rates these would tell a turn too late
constexpr double kSpeedWindow_s = 7e-3;

// rotation vector of a small turn, in W
Vec3 turnBetween(Quat from, Quat to) {
  const Quat turn = to * conjugate(from);
  return Vec3{turn.x, turn.y, turn.z} * (turn.w < 0 ? -2.0 : 2.0);
}

// 1 for a debt of the reserve or more: then only a wrench that clearly takes energy returns, and slowly,
// because after the motion reverses the mean speed still has the old direction
double debtOf(const PassivityState& state, double reserve_J) {
  return std::clamp(-state.level_J / std::max(reserve_J, kMinReserve_J), 0.0, 1.0);
}

double workOf(const Wrench& wrench, const Pose& from, const Pose& to) {
  return dot(wrench.force_N, to.p - from.p) + dot(wrench.torque_Nm, turnBetween(from.q, to.q));
}

}  // namespace

PassivityControl::PassivityControl(const PassivitySettings& settings, double rate_hz) noexcept
    : settings_(settings), period_s_(1 / rate_hz) {
  assert(rate_hz > 0);
  settings_.delay_ticks = std::min(settings.delay_ticks, PassivitySettings::kMaxDelay);
  settings_.damping_Ns_per_m = std::max(0.0, settings.damping_Ns_per_m);
  settings_.rotational_damping_Nms_per_rad = std::max(0.0, settings.rotational_damping_Nms_per_rad);
  settings_.reserve_J = std::max(0.0, settings.reserve_J);
  settings_.capacity_J = std::max(settings_.reserve_J, settings.capacity_J);
  settings_.lag_s = std::max(0.0, settings.lag_s);
  horizon_s_ = (static_cast<double>(settings_.delay_ticks) + kHorizonTicks) * period_s_ + settings_.lag_s;
  if (settings_.lag_s > 0) {
    const double ticks = period_s_ / settings_.lag_s;
    left_ = detExp(-ticks);
    mean_left_ = (1 - left_) / ticks;
  }
  speed_ticks_ = static_cast<std::uint32_t>(std::max(1.0, std::min(kSpeedWindow_s * rate_hz, 7.0)));
  state_.level_J = settings_.reserve_J;
  assert(left_ >= 0 && left_ <= 1 && mean_left_ >= 0);
  assert(settings_.reserve_J <= settings_.capacity_J);
}

// Accounts for the wrenches that acted since the newest pose. If that pose is several ticks old, it is
// unknown in which tick the handle moved, and the worst case counts.
void PassivityControl::observe(const Pose& X_WH, double held_J) noexcept {
  constexpr std::size_t kPoses = PassivityState::kPoses, kWrenches = PassivityState::kWrenches;
  assert(isFinite(X_WH.p) && isFinite(X_WH.q) && "the gate admitted it");
  assert(state_.next_pose < kPoses && state_.known_poses <= kPoses && state_.next_wrench < kWrenches);
  if (state_.known_poses > 0) {
    const Pose& before = state_.poses[(state_.next_pose + kPoses - 1) % kPoses];
    const std::size_t ticks =
        std::clamp<std::size_t>(state_.unseen_ticks, 1, kWrenches - 1 - settings_.delay_ticks);
    double given_J = -HUGE_VAL;
    for (std::size_t back = 1; back <= ticks; ++back) {
      const std::size_t at = (state_.next_wrench + 2 * kWrenches - back - settings_.delay_ticks) % kWrenches;
      given_J = std::max(given_J, workOf(state_.rendered[at], before, X_WH));
    }
    // |way|² over n ticks is at most n times the sum of the squares, so the device lost at least this much
    const Pose& oldest = state_.poses[(state_.next_pose + kPoses - state_.known_poses) % kPoses];
    const double over_ticks = static_cast<double>(state_.known_poses);
    const Vec3 turn = turnBetween(oldest.q, X_WH.q);
    const double lost_J = (settings_.damping_Ns_per_m * normSquared(X_WH.p - oldest.p) +
                           settings_.rotational_damping_Nms_per_rad * normSquared(turn)) /
                          (over_ticks * over_ticks * period_s_);
    // after a gap the window for speed and damping restarts; damping counts only while the window is complete
    const bool is_whole = ticks == 1 && state_.known_poses == kPoses;
    if (ticks > 1) state_.known_poses = 0;
    state_.level_J =
        std::min(settings_.capacity_J + held_J, state_.level_J - given_J + (is_whole ? lost_J : 0));
  }
  state_.poses[state_.next_pose] = X_WH;
  state_.next_pose = (state_.next_pose + 1) % kPoses;
  state_.known_poses = std::min<std::uint32_t>(kPoses, state_.known_poses + 1);
  state_.unseen_ticks = 0;
}

// The impulse of wrenches that were given but have not acted yet: d ticks of them, and the decay behind the
// lag.
Wrench PassivityControl::underWay() const noexcept {
  constexpr std::size_t kWrenches = PassivityState::kWrenches;
  Wrench sum{state_.acting.force_N * settings_.lag_s, state_.acting.torque_Nm * settings_.lag_s};
  for (std::size_t back = 1; back <= settings_.delay_ticks; ++back) {
    const Wrench& one = state_.rendered[(state_.next_wrench + kWrenches - back) % kWrenches];
    sum.force_N += one.force_N * period_s_;
    sum.torque_Nm += one.torque_Nm * period_s_;
  }
  return sum;
}

PassivityControl::Wish PassivityControl::wish(const Wrench& wanted) const noexcept {
  constexpr std::size_t kPoses = PassivityState::kPoses;
  if (state_.known_poses < 2) return {state_.share, 0, 0};
  const std::uint32_t ticks = std::min(state_.known_poses - 1, speed_ticks_);
  const double over_s = ticks * period_s_;
  const Pose& newest = state_.poses[(state_.next_pose + kPoses - 1) % kPoses];
  const Pose& oldest = state_.poses[(state_.next_pose + kPoses - 1 - ticks) % kPoses];
  const double power_W = workOf(wanted, oldest, newest) / over_s;
  const double debt = debtOf(state_, settings_.reserve_J);
  const double gives = std::clamp(power_W / kSmallPower_W + debt, 0.0, 1.0);
  if (gives <= 0) return {1, power_W, 0};
  // wrenches under way will act regardless of what is rendered now, so they are paid first
  const double under_way_J = workOf(underWay(), oldest, newest) / over_s;
  const double free_J = std::max(0.0, state_.level_J - std::max(0.0, under_way_J));
  // early enough for a fall by kMostStep_N a tick
  const double fall_s = (0.5 * norm(wanted.force_N) / kMostStep_N + 1 - kHorizonTicks) * period_s_;
  const double horizon_s = horizon_s_ + std::max(0.0, fall_s);
  const double affordable = power_W > 0 ? std::min(1.0, free_J / (power_W * horizon_s))
                            : debt > 0  ? 0.0
                                        : 1.0;
  return {1 - gives * (1 - affordable), power_W, free_J};
}

// The share moves toward the wish. While it falls by `step` a tick from s to w, the wrench gives
// P·T·(s − w)²/(2·step) more than if it fell at once: it falls faster where the tank has less.
double PassivityControl::nextShare(const Wrench& wanted) const noexcept {
  const Wish to = wish(wanted);
  const double size_N = norm(wanted.force_N);
  const double most = size_N > kMostStep_N ? kMostStep_N / size_N : 1.0;
  const double way = to.share - state_.share;
  if (way >= 0) {
    const double rise = kShareStep * (1 - 0.9 * debtOf(state_, settings_.reserve_J));
    return state_.share + std::min({way, rise, most});
  }
  const double cost_J = std::max(0.0, to.power_W) * period_s_ * way * way / 2;
  const double step = cost_J <= most * to.free_J ? most : to.free_J > 0 ? cost_J / to.free_J : 1.0;
  return state_.share - std::min(-way, step);
}

Wrench PassivityControl::limited(const Pose& X_WH, bool fresh, const Wrench& wanted, double held_J,
                                 std::int64_t elapsed_ticks) noexcept {
  // the device kept rendering the last wrench while the loop missed ticks
  const auto missed = std::clamp<std::int64_t>(elapsed_ticks - 1, 0, PassivityState::kWrenches);
  const Wrench last = state_.given;
  for (std::int64_t i = 0; i < missed; ++i) rendered(last);
  // the gate refuses wrenches that are not finite
  if (fresh && isFinite(wanted.force_N) && isFinite(wanted.torque_Nm)) {
    // without a force no spring is loaded: energy that the tissue took earlier expires, and so does any debt
    if (wanted == Wrench{}) state_.level_J = settings_.reserve_J;
    assert(!(held_J < 0));
    observe(X_WH, held_J);
    state_.share = nextShare(wanted);
    assert(!(state_.share < 0) && !(state_.share > 1 + 1e-12));
    assert(!(state_.level_J > settings_.capacity_J + held_J));
  }
  return {wanted.force_N * state_.share, wanted.torque_Nm * state_.share};
}

void PassivityControl::rendered(const Wrench& at_handle_W) noexcept {
  assert(isFinite(at_handle_W.force_N) && isFinite(at_handle_W.torque_Nm));
  assert(state_.next_wrench < PassivityState::kWrenches);
  const Vec3 force = state_.acting.force_N - at_handle_W.force_N;
  const Vec3 torque = state_.acting.torque_Nm - at_handle_W.torque_Nm;
  state_.rendered[state_.next_wrench] = {at_handle_W.force_N + force * mean_left_,
                                         at_handle_W.torque_Nm + torque * mean_left_};
  state_.given = at_handle_W;
  state_.acting = {at_handle_W.force_N + force * left_, at_handle_W.torque_Nm + torque * left_};
  state_.next_wrench = (state_.next_wrench + 1) % PassivityState::kWrenches;
  state_.unseen_ticks = std::min<std::uint32_t>(PassivityState::kWrenches, state_.unseen_ticks + 1);
}

}  // namespace needlelab
