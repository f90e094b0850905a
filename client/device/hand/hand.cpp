#include "client/device/hand/hand.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/haptics/det_math.h"
#include "common/haptics/geometry.h"

namespace needlelab {
namespace {

// Returns twice the vector part of the shortest turn from `from` to `to`: the rotation vector of a small
// turn, in their common frame; its length is 2 sin(angle/2).
Vec3 turnVector(Quat from, Quat to) {
  const Quat d = to * conjugate(from);
  return Vec3{d.x, d.y, d.z} * (d.w < 0 ? -2.0 : 2.0);
}

constexpr double kFollow_per_s = 8;   // speed by distance: a quarter of it is left after 0.17 s
constexpr double kSpeedUp_s = 0.025;  // 8/s · 25 ms is below 1/4: no overshoot
constexpr double kRotationError = 1e-3;

bool isUsable(const SteeringTarget& target) {
  return isFinite(target.X_WT.p) && isFinite(target.X_WT.q) && std::isfinite(target.plunger) &&
         std::abs(dot(target.X_WT.q, target.X_WT.q) - 1) <= kRotationError;
}

Vec3 atMost(Vec3 v, double length) {
  const double is = norm(v);
  return is > length ? v * (length / is) : v;
}

constexpr double kMaxCorrection_m = 0.05;

}  // namespace

std::uint64_t HandRandom::next() noexcept {
  state_ += 0x9E3779B97F4A7C15u;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

double HandRandom::uniform() noexcept {
  return static_cast<double>(next() >> 11) * 0x1p-53;
}

HandTremor::HandTremor(double amplitude_m, std::uint64_t seed, double step_s)
    : share_m_(amplitude_m / static_cast<double>(kPartials)) {
  HandRandom random(seed);
  for (auto& axis : partials_)
    for (Partial& partial : axis) {
      partial.hz = kLowHz + (kHighHz - kLowHz) * random.uniform();
      const double phase = 2 * kPi * random.uniform();
      const double turn = 2 * kPi * partial.hz * step_s;
      partial.c = detCos(phase), partial.s = detSin(phase);
      partial.turn_c = detCos(turn), partial.turn_s = detSin(turn);
    }
}

Vec3 HandTremor::next() noexcept {
  if (share_m_ == 0) return {};
  double sum[3] = {0, 0, 0};
  for (std::size_t i = 0; i < 3; ++i)
    for (Partial& p : partials_[i]) {
      const double c = p.c * p.turn_c - p.s * p.turn_s, s = p.s * p.turn_c + p.c * p.turn_s;
      // one Newton step towards length 1, so that rounding does not accumulate
      const double scale = 1.5 - 0.5 * (c * c + s * s);
      p.c = c * scale, p.s = s * scale;
      sum[i] += p.s;
    }
  return Vec3{sum[0], sum[1], sum[2]} * share_m_;
}

SteeredAim::SteeredAim(std::shared_ptr<HandSteering> steering, const HandAim& start, double step_s)
    : steering_(std::move(steering)),
      step_s_(step_s),
      share_(step_s / kSpeedUp_s),
      aim_(start),
      target_{start.X_WT, start.plunger} {}

HandAim SteeredAim::next() noexcept {
  if (SteeringTarget newest; steering_->fetch(newest) && isUsable(newest)) {
    newest.X_WT.q = normalized(newest.X_WT.q);
    newest.plunger = std::clamp(newest.plunger, 0.0, 1.0);
    target_ = newest;
  }
  Pose& X = aim_.X_WT;
  v_W_mps_ += (atMost((target_.X_WT.p - X.p) * kFollow_per_s, kMaxAimSpeed_mps) - v_W_mps_) * share_;
  X.p += v_W_mps_ * step_s_;
  const Vec3 turn = turnVector(X.q, target_.X_WT.q);
  w_W_radps_ += (atMost(turn * kFollow_per_s, kMaxAimTurn_radps) - w_W_radps_) * share_;
  const Vec3 half = w_W_radps_ * (step_s_ / 2);
  X.q = normalized(Quat{half.x, half.y, half.z, 1} * X.q);
  const double most = kMaxPlungerSpeed_per_s * step_s_;
  aim_.plunger += std::clamp(target_.plunger - aim_.plunger, -most, most);
  return aim_;
}

Hand::Hand(const HandOptions& options, HandPlan plan, const Pose& X_HT, double step_s,
           std::shared_ptr<HandSteering> steering)
    : options_(options),
      plan_(std::move(plan)),
      X_TH_(inverse(X_HT)),
      step_s_(step_s),
      tremor_(options.tremor_m, options.seed, step_s),
      // the first read of a device precedes the hand's first step
      plunger_(plan_.start().plunger),
      wanted_(startPose()) {
  if (steering) steered_.emplace(std::move(steering), plan_.start(), step_s);
}

Pose Hand::startPose() const {
  return plan_.start().X_WT * X_TH_;
}

bool Hand::finished() const noexcept {
  if (steered_) return false;
  const double all = plan_.duration_s() * static_cast<double>(options_.repeat);
  return options_.repeat != 0 && static_cast<double>(step_) * step_s_ >= all;
}

HandAim Hand::plannedAim() const noexcept {
  // time within the plan, without whole repeats
  double t = static_cast<double>(step_) * step_s_;
  if (const double duration = plan_.duration_s(); duration > 0 && t >= duration) {
    const double done = static_cast<double>(static_cast<std::int64_t>(t / duration));
    const bool last = options_.repeat != 0 && done >= static_cast<double>(options_.repeat);
    t = last ? duration : std::max(0.0, t - done * duration);
  }
  return plan_.at(t);
}

Wrench Hand::pull(const HandleState& handle) noexcept {
  const HandAim aim = steered_ ? steered_->next() : plannedAim();
  plunger_ = aim.plunger;
  presses_cap_button_ = aim.presses_cap_button;

  // the tip's aim with tremor and correction, moved to the handle; velocity from the previous step
  const Pose before = wanted_;
  const Pose planned = aim.X_WT * X_TH_;
  if (options_.correction_per_s > 0) {
    correction_W_m_ += (planned.p - handle.X_WH.p) * (options_.correction_per_s * step_s_);
    if (const double far = norm(correction_W_m_); far > kMaxCorrection_m)
      correction_W_m_ = correction_W_m_ * (kMaxCorrection_m / far);
  }
  wanted_ = {planned.p + correction_W_m_ + tremor_.next(), planned.q};
  const double per_s = step_ == 0 ? 0 : 1 / step_s_;
  const Vec3 v_wanted = (wanted_.p - before.p) * per_s;
  const Vec3 w_wanted = turnVector(before.q, wanted_.q) * per_s;
  const double since_start_s = static_cast<double>(step_) * step_s_;
  ++step_;
  if (options_.release_s > 0 && since_start_s >= options_.release_s) return {};

  Wrench pull = {options_.stiffness_N_per_m * (wanted_.p - handle.X_WH.p) +
                     options_.damping_Ns_per_m * (v_wanted - handle.v_W_mps),
                 options_.rotational_stiffness_Nm_per_rad * turnVector(handle.X_WH.q, wanted_.q) +
                     options_.rotational_damping_Nms_per_rad * (w_wanted - handle.w_W_radps)};
  if (options_.bracing_N_per_m > 0) {
    const Vec3 axis = zAxis(aim.X_WT.q);
    const double short_by_m =
        dot(axis, wanted_.p - handle.X_WH.p) + kBracingTime_s * dot(axis, v_wanted - handle.v_W_mps);
    pull.force_N += axis * (options_.bracing_N_per_m * short_by_m);
  }
  if (options_.grip_changes_s > 0 && since_start_s >= options_.grip_changes_s)
    return {pull.force_N * options_.grip_share, pull.torque_Nm * options_.grip_share};
  return pull;
}

}  // namespace needlelab
