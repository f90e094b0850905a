#include "client/device/hand/simulated_device.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "common/base/range.h"
#include "common/haptics/det_math.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {
namespace {

// Rounds `value` to a whole number of steps (half a step rounds up); unchanged when the step is 0. Any unit.
double toStep(double value, double step) {
  return step > 0 ? std::floor(value / step + 0.5) * step : value;
}

Status checked(const SimulatedDeviceOptions& o, double rate_hz) {
  struct Row {
    const char* field;
    double value;
    NumberRange range;
  };
  const HandOptions& h = o.hand;
  const Row rows[] = {
      {"rate in Hz", rate_hz, {kMinRateHz, kMaxRateHz}},
      {"hand stiffness in N/m", h.stiffness_N_per_m, {0, 10'000}},
      {"hand damping in N·s/m", h.damping_Ns_per_m, {0, 100}},
      {"hand bracing in N/m", h.bracing_N_per_m, {0, 10'000}},
      {"hand rotational stiffness in N·m/rad", h.rotational_stiffness_Nm_per_rad, {0, 100}},
      {"hand rotational damping in N·m·s/rad", h.rotational_damping_Nms_per_rad, {0, 5}},
      {"hand correction per s", h.correction_per_s, {0, 20}},
      {"hand's letting go in s", h.release_s, {0, 1e6}},
      {"time of a change of grip in s", h.grip_changes_s, {0, 1e6}},
      {"share of a changed grip", h.grip_share, {0, 100}},
      {"hand tremor in m", h.tremor_m, {0, 0.005}},
      {"mass in kg", o.limits.apparent_mass_kg, {0.01, 100}},
      {"damping in N·s/m", o.limits.damping_Ns_per_m, {0, 100}},
      {"inertia in kg·m²", o.inertia_kgm2, {1e-4, 10}},
      {"rotational damping in N·m·s/rad", o.rotational_damping_Nms_per_rad, {0, 1}},
      {"dry friction in N", o.dry_friction_N, {0, 10}},
      {"encoder step in m", o.encoder_step_m, {0, 0.01}},
      {"encoder step in rad", o.encoder_step_rad, {0, 0.1}},
      {"delay in ticks", static_cast<double>(o.delay_ticks), {0, SimulatedDevice::kMaxDelayTicks}},
      {"lag in s", o.lag_s, {0, 0.1}},
      {"backlash in m", o.backlash_m, {0, 0.01}},
      {"integration rate in Hz", o.integration_hz, {1000, 1e6}},
  };
  for (const Row& row : rows)
    if (!row.range.contains(row.value))
      return outOfRange(std::string("simulated device: ") + row.field, row.value, row.range);
  return {};
}

constexpr std::uint64_t kSlots = SimulatedDevice::kMaxDelayTicks + 1;

// near rest, an angle is twice a quaternion component, so half a step of it is a step of the angle
Pose asEncoded(const Pose& X, double step_m, double step_rad) {
  Pose seen{{toStep(X.p.x, step_m), toStep(X.p.y, step_m), toStep(X.p.z, step_m)}, X.q};
  if (step_rad > 0) {
    const double step = step_rad / 2;
    seen.q =
        normalized(Quat{toStep(X.q.x, step), toStep(X.q.y, step), toStep(X.q.z, step), toStep(X.q.w, step)});
  }
  return seen;
}

constexpr double kTwoPi = 2 * std::numbers::pi;

}  // namespace

SimulatedDevice::SimulatedDevice(const SimulatedDeviceOptions& options, HandPlan plan)
    : options_(options), plan_(std::move(plan)) {
  info_.name = fmt::format("simulated Virtuose 6D Desktop, hand {:g} N/m and {:g} N·s/m",
                           options.hand.stiffness_N_per_m, options.hand.damping_Ns_per_m);
  info_.limits = options.limits;
  if (options.lag_s == 0) info_.delay_ticks = options.delay_ticks;
  info_.plunger = PlungerSource::kAnalog;  // the hand supplies the position
}

Status SimulatedDevice::open(double rate_hz) {
  RETURN_IF_ERROR(checked(options_, rate_hz));
  steps_per_tick_ =
      std::max<std::int64_t>(1, static_cast<std::int64_t>(options_.integration_hz / rate_hz + 0.5));
  step_s_ = 1 / (rate_hz * static_cast<double>(steps_per_tick_));
  hand_.emplace(options_.hand, plan_, options_.X_HT, step_s_, options_.steering);
  handle_ = {hand_->startPose(), {}, {}};
  tick_ = 0;
  pending_.fill({});
  lag_left_ = options_.lag_s > 0 ? detExp(-step_s_ / options_.lag_s) : 0;
  lagging_ = {};
  play_m_ = {};
  force_work_J_ = torque_work_J_ = 0;
  return {};
}

// Between the stops of the play, the motors move by themselves against the device's damping. The force
// reaches the handle where they push on a stop; at the other stop, the handle moves them along.
Vec3 SimulatedDevice::throughPlay(Vec3 force_N) noexcept {
  const double max_m = options_.backlash_m / 2;
  if (max_m == 0) return force_N;
  const double damping = std::max(options_.limits.damping_Ns_per_m, 0.1);
  Vec3 through;
  for (double Vec3::*axis : {&Vec3::x, &Vec3::y, &Vec3::z}) {
    const double force = force_N.*axis;
    double& play = play_m_.*axis;
    play = std::clamp(play + (force / damping - handle_.v_W_mps.*axis) * step_s_, -max_m, max_m);
    if (force != 0 && play == std::copysign(max_m, force)) through.*axis = force;
  }
  return through;
}

void SimulatedDevice::integrate(const Wrench& given) noexcept {
  const double mass = options_.limits.apparent_mass_kg;
  const Wrench hand = hand_->pull(handle_);
  lagging_ = {given.force_N + (lagging_.force_N - given.force_N) * lag_left_,
              given.torque_Nm + (lagging_.torque_Nm - given.torque_Nm) * lag_left_};
  const Wrench wrench{throughPlay(lagging_.force_N), lagging_.torque_Nm};

  // translation: semi-implicit Euler; dry friction removes at most the remaining speed
  Vec3& v = handle_.v_W_mps;
  v += (hand.force_N + wrench.force_N - v * options_.limits.damping_Ns_per_m) * (step_s_ / mass);
  if (options_.dry_friction_N > 0) {
    const double speed = norm(v), loss = options_.dry_friction_N * step_s_ / mass;
    v = speed > loss ? v * (1 - loss / speed) : Vec3{};
  }
  handle_.X_WH.p += v * step_s_;
  force_work_J_ += dot(wrench.force_N, v) * step_s_;

  // rotation of a ball
  Vec3& w = handle_.w_W_radps;
  w += (hand.torque_Nm + wrench.torque_Nm - w * options_.rotational_damping_Nms_per_rad) *
       (step_s_ / options_.inertia_kgm2);
  torque_work_J_ += dot(wrench.torque_Nm, w) * step_s_;
  const Vec3 half = w * (step_s_ / 2);
  handle_.X_WH.q = normalized(Quat{half.x, half.y, half.z, 1} * handle_.X_WH.q);
}

// one tick of time: from tick_ − 1 to tick_
void SimulatedDevice::advance() noexcept {
  const Wrench due = pending_[(tick_ - 1) % kSlots];
  for (std::int64_t i = 0; i < steps_per_tick_; ++i) integrate(due);
  // until the next write, the last wrench holds
  pending_[(tick_ + options_.delay_ticks) % kSlots] = pending_[(tick_ - 1 + options_.delay_ticks) % kSlots];
}

DeviceRead SimulatedDevice::read(DeviceReading& reading) noexcept {
  if (!hand_) return DeviceRead::kNoUpdate;
  if (hand_->finished()) return DeviceRead::kFinished;
  if (tick_ > 0) advance();
  ++tick_;
  reading.X_WH = asEncoded({handle_.X_WH.p + play_m_, handle_.X_WH.q}, options_.encoder_step_m,
                           options_.encoder_step_rad);
  reading.speed_mps = norm(handle_.v_W_mps);
  reading.plunger = hand_->plunger();
  reading.buttons = hand_->pressesCapButton() ? 1u << kCapButton : 0u;
  return DeviceRead::kFresh;
}

void SimulatedDevice::write(const GuardedWrench& at_handle_W) noexcept {
  if (tick_ > 0) pending_[(tick_ - 1 + options_.delay_ticks) % kSlots] = at_handle_W.wrench();
}

std::uint64_t SimulatedDevice::skip(std::uint64_t ticks) noexcept {
  std::uint64_t moved = 0;
  if (!hand_) return moved;
  for (; moved < ticks && !hand_->finished(); ++moved, ++tick_)
    if (tick_ > 0) advance();
  return moved;
}

void SimulatedDevice::close() noexcept {
  hand_.reset();
}

PivotDevice::PivotDevice(const PivotMotion& motion) : motion_(motion) {
  info_.name = "simulated hand that swings the handle about a dimple";
  info_.renders_force = false;
  info_.renders_torque = false;
}

Status PivotDevice::open(double rate_hz) {
  rate_hz_ = rate_hz;
  // the first tick at or after `seconds`
  end_tick_ = motion_.seconds > 0 ? static_cast<std::uint64_t>(std::ceil(motion_.seconds * rate_hz))
                                  : std::numeric_limits<std::uint64_t>::max();
  tick_ = 0;
  random_ = motion_.seed;
  return {};
}

Pose PivotDevice::handleAt(double t_s) const noexcept {
  // a swing about a rotating horizontal axis, and a slow turn of the handle about its needle
  const double azimuth = kTwoPi * t_s / motion_.turn_period_s;
  const double half = 0.5 * motion_.swing_rad * std::sin(kTwoPi * t_s / motion_.swing_period_s);
  const double half_turn = 0.25 * std::sin(kTwoPi * t_s / (1.7 * motion_.turn_period_s));
  const Quat swing{std::cos(azimuth) * std::sin(half), std::sin(azimuth) * std::sin(half), 0, std::cos(half)};
  const Quat turn{0, 0, std::sin(half_turn), std::cos(half_turn)};
  const Quat down{1, 0, 0, 0};  // half a turn about x: +z of the handle points down
  Pose X_WH;
  X_WH.q = normalized(swing * down * turn);
  Vec3 tip = motion_.p_WP_m;
  if (motion_.slip_at_s > 0 && t_s >= motion_.slip_at_s) tip.x += motion_.slip_m;
  X_WH.p = tip - rotate(X_WH.q, motion_.X_HT.p);
  return X_WH;
}

// nearly normal: the sum of twelve uniform numbers has variance 1
double PivotDevice::noise() noexcept {
  double sum = -6;
  for (int i = 0; i < 12; ++i) {
    random_ = random_ * 6364136223846793005u + 1442695040888963407u;
    sum += static_cast<double>(random_ >> 11) * 0x1p-53;
  }
  return sum * motion_.noise_m;
}

std::uint64_t PivotDevice::skip(std::uint64_t ticks) noexcept {
  const std::uint64_t moved = std::min(ticks, end_tick_ - tick_);
  tick_ += moved;
  return moved;
}

DeviceRead PivotDevice::read(DeviceReading& reading) noexcept {
  const double t_s = static_cast<double>(tick_) / rate_hz_;
  if (tick_ >= end_tick_) return DeviceRead::kFinished;
  ++tick_;
  reading = {};
  reading.X_WH = handleAt(t_s);
  Vec3& p = reading.X_WH.p;
  p += {noise(), noise(), noise()};
  const double step = motion_.encoder_step_m;
  p = {toStep(p.x, step), toStep(p.y, step), toStep(p.z, step)};
  return DeviceRead::kFresh;
}

}  // namespace needlelab
