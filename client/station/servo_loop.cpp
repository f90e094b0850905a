#include "station/servo_loop.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "haptics/tool_transform.h"

namespace needlelab {
namespace {

constexpr double kClosing_s = 0.02;     // the force fades out within this time before a planned end
constexpr double kAfterFault_s = 0.05;  // long enough for the gate's ramp to zero to be rendered and recorded
constexpr std::int64_t kLead_ns = 2'000'000;  // between the call of run and the first tick

std::uint64_t ticksIn(double seconds, double rate_hz) {
  return static_cast<std::uint64_t>(std::max(1.0, std::ceil(seconds * rate_hz)));
}

std::int32_t held(std::int64_t duration_ns) {
  return static_cast<std::int32_t>(
      std::clamp<std::int64_t>(duration_ns, 0, std::numeric_limits<std::int32_t>::max()));
}

void put(double (&to)[3], Vec3 v) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

}  // namespace

ServoLoop::ServoLoop(const SceneModel& model, Device& device, LoopClock& clock, SampleRing& ring,
                     const ServoSettings& settings)
    : model_(model),
      device_(device),
      clock_(clock),
      ring_(ring),
      settings_(settings),
      period_ns_(1e9 / settings.rate_hz),
      closing_ticks_(ticksIn(kClosing_s, settings.rate_hz)),
      after_fault_ticks_(ticksIn(kAfterFault_s, settings.rate_hz)),
      gate_(device.info().limits, settings.rate_hz) {
  report_.layer = -1;
}

std::int64_t ServoLoop::dueNs(std::uint64_t tick) const noexcept {
  return start_ns_ + std::llround(static_cast<double>(tick) * period_ns_);
}

void ServoLoop::run() noexcept {
  start_ns_ = clock_.nowNs() + kLead_ns;
  std::uint64_t number = 0;
  for (;;) {
    std::int64_t due_ns = dueNs(number);
    clock_.sleepUntilNs(due_ns);
    const std::int64_t began_ns = clock_.nowNs();
    const std::int64_t late_ns = began_ns - due_ns;
    stats_.wakeup.add(late_ns);

    // ticks whose time is over are missed: the tick number goes on without them
    std::int64_t elapsed = 1;
    if (static_cast<double>(late_ns) >= period_ns_) {
      const auto missed = static_cast<std::uint64_t>(static_cast<double>(late_ns) / period_ns_);
      number += missed;
      elapsed += static_cast<std::int64_t>(missed);
      stats_.missed_ticks += missed;
      missed_.store(stats_.missed_ticks, std::memory_order_relaxed);
      device_.skip(missed);
      due_ns = dueNs(number);
    }
    if (settings_.max_ticks > 0 && number >= settings_.max_ticks) {
      stats_.ticks = settings_.max_ticks;
      stats_.missed_ticks -= number - settings_.max_ticks;
      stats_.end = ServoEnd::kTicksDone;
      break;
    }
    const bool goes_on = tick(number, due_ns, began_ns, elapsed);
    stats_.ticks = stats_.samples + stats_.missed_ticks;
    if (!goes_on) break;
    ++number;
  }
  stats_.fault = gate_.fault();
  device_.write(GuardedWrench{});
}

// 1 in the lesson; falls to 0 over the last ticks before a planned end
double ServoLoop::closingShare(std::uint64_t number) noexcept {
  if (!closing_) {
    const bool last_ticks = settings_.max_ticks > 0 && number + closing_ticks_ >= settings_.max_ticks;
    if (!last_ticks && !stop_.load(std::memory_order_relaxed)) return 1;
    closing_ = true;
    closing_since_ = number;
  }
  const std::uint64_t done = std::min(number - closing_since_ + 1, closing_ticks_);
  return 1 - static_cast<double>(done) / static_cast<double>(closing_ticks_);
}

bool ServoLoop::tick(std::uint64_t number, std::int64_t due_ns, std::int64_t began_ns,
                     std::int64_t elapsed_ticks) noexcept {
  // device → tip
  const DeviceRead read = device_.read(reading_);
  const std::int64_t read_ns = clock_.nowNs();
  if (read == DeviceRead::kFinished) {
    stats_.end = ServoEnd::kDeviceFinished;
    return false;
  }
  const Pose& X_WH = reading_.X_WH;
  const Pose X_WT = tipFromHandle(X_WH, settings_.X_HT);

  // gate → engine
  const double share = closingShare(number);
  Wrench wanted_at_handle;
  if (gate_.admit({X_WT.p, X_WT.q}, read == DeviceRead::kFresh, reading_.speed_mps, elapsed_ticks)) {
    handle_ = X_WH;
    tip_ = {X_WT.p, normalized(X_WT.q)};
    step(model_, {tip_.p, tip_.q}, state_, report_);
    gate_.noteOutside(report_.depth_m <= 0);
    const Wrench wanted{report_.wrench_W.force_N * share, report_.wrench_W.torque_Nm * share};
    wanted_at_handle = wrenchAtHandle(wanted, tip_.p, handle_.p);
  } else {
    // not stepped: what the engine last said of phase and layer still stands, its forces do not
    report_.flags = kFlagNotStepped;
    if (isFinite(X_WT.p) && isFinite(X_WT.q) && isFinite(X_WH.p)) {
      gate_.noteOutside(signedDepth(model_.limb, X_WT.p) <= 0);
      const double length = std::sqrt(dot(X_WT.q, X_WT.q));
      handle_ = X_WH;
      tip_.p = X_WT.p;
      if (length > 0.5) tip_.q = normalized(X_WT.q);
    }
  }

  // gate → device
  const GuardedWrench guarded = gate_.guard(wanted_at_handle);
  const std::int64_t computed_ns = clock_.nowNs();
  device_.write(guarded);
  const std::int64_t wrote_ns = clock_.nowNs();

  engine_ns_ = computed_ns - read_ns;
  device_ns_ = (read_ns - began_ns) + (wrote_ns - computed_ns);
  stats_.tick.add(wrote_ns - began_ns);
  stats_.engine.add(engine_ns_);
  stats_.device.add(device_ns_);
  record(number, due_ns, guarded.wrench());

  // is it over?
  if (gate_.fault() != Fault::kNone) {
    if (fault_since_ == 0) fault_since_ = number + 1;
    if (number + 1 - fault_since_ < after_fault_ticks_) return true;
    stats_.end = ServoEnd::kFault;
    return false;
  }
  fault_since_ = 0;
  if (!closing_ || number - closing_since_ + 1 < closing_ticks_) return true;
  stats_.end = settings_.max_ticks > 0 && number + 1 >= settings_.max_ticks ? ServoEnd::kTicksDone
                                                                            : ServoEnd::kStopped;
  return false;
}

void ServoLoop::record(std::uint64_t number, std::int64_t due_ns, const Wrench& at_handle) noexcept {
  GestureSample sample;
  sample.tick = number;
  sample.time_ns = due_ns;
  put(sample.p_WT_m, tip_.p);
  sample.q_WT[0] = tip_.q.x;
  sample.q_WT[1] = tip_.q.y;
  sample.q_WT[2] = tip_.q.z;
  sample.q_WT[3] = tip_.q.w;
  sample.speed_mps = report_.speed_mps;
  put(sample.force_W_N, at_handle.force_N);
  // what the device renders at the handle, seen from the tip again
  put(sample.torque_W_Nm, at_handle.torque_Nm - cross(tip_.p - handle_.p, at_handle.force_N));
  if (report_.phase != Phase::kFree) put(sample.wall_W_m, report_.p_wall_W_m);
  sample.insertion_m = report_.insertion_m;
  sample.lateral_error_m = report_.lateral_error_m;
  sample.plunger = std::isfinite(reading_.plunger) ? std::clamp(reading_.plunger, 0.0, 1.0) : 0;
  sample.device_ns = held(device_ns_);
  sample.engine_ns = held(engine_ns_);
  sample.flags = report_.flags | gate_.flags();
  sample.buttons = reading_.buttons;
  sample.layer = static_cast<std::int8_t>(report_.layer);
  sample.phase = static_cast<std::uint8_t>(report_.phase);
  sample.fault = static_cast<std::uint8_t>(gate_.fault());

  ++stats_.samples;
  for (std::uint32_t bits = sample.flags; bits != 0; bits &= bits - 1)
    ++stats_.flag_ticks[static_cast<std::size_t>(std::countr_zero(bits))];
  // a full ring counts what it refuses; the loop never waits for anybody
  ring_.push(sample);
}

}  // namespace needlelab
