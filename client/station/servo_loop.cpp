#include "station/servo_loop.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace needlelab {
namespace {

constexpr double kClosing_s = 0.02;     // the force fades out within this time before an end
constexpr double kAfterFault_s = 0.05;  // long enough for the gate's ramp to zero to be rendered and recorded
constexpr std::int64_t kLead_ns = 2'000'000;  // between the call of run and the first tick

std::uint64_t ticksIn(double seconds, double rate_hz) {
  return static_cast<std::uint64_t>(std::max(1.0, std::ceil(seconds * rate_hz)));
}

}  // namespace

ServoLoop::ServoLoop(const SceneModel& model, Device& device, LoopClock& clock, SampleRing& ring,
                     const ServoSettings& settings)
    : device_(device),
      clock_(clock),
      ring_(ring),
      settings_(settings),
      period_ns_(1e9 / settings.rate_hz),
      closing_ticks_(ticksIn(kClosing_s, settings.rate_hz)),
      after_fault_ticks_(ticksIn(kAfterFault_s, settings.rate_hz)),
      chain_(model, device.info().limits, settings.X_HT) {}

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
    const std::uint64_t missed = miss(began_ns - due_ns);
    if (missed > 0) {
      number += missed;
      due_ns = dueNs(number);
    }
    if (settings_.max_ticks > 0 && number >= settings_.max_ticks) {
      stats_.ticks = settings_.max_ticks;
      stats_.missed_ticks -= number - settings_.max_ticks;
      stats_.end = ServoEnd::kTicksDone;
      break;
    }
    const bool goes_on = tick(number, due_ns, began_ns, static_cast<std::int64_t>(missed) + 1);
    stats_.ticks = stats_.samples + stats_.missed_ticks;
    if (!goes_on) break;
    ++number;
  }
  stats_.fault = chain_.gate().fault();
  device_.write(GuardedWrench{});
  ended_.store(true, std::memory_order_release);
}

// ticks whose time is over are missed: the tick number goes on without them
std::uint64_t ServoLoop::miss(std::int64_t late_ns) noexcept {
  stats_.wakeup.add(late_ns);
  if (static_cast<double>(late_ns) < period_ns_) return 0;
  const auto missed = static_cast<std::uint64_t>(static_cast<double>(late_ns) / period_ns_);
  ++stats_.late_wakeups;
  stats_.missed_ticks += missed;
  missed_.store(stats_.missed_ticks, std::memory_order_relaxed);
  device_.skip(missed);
  return missed;
}

// what other threads asked for since the last tick
void ServoLoop::hearOthers(std::uint64_t number) noexcept {
  if (acknowledged_.load(std::memory_order_relaxed)) {
    acknowledged_.store(false, std::memory_order_relaxed);
    chain_.acknowledge();
  }
  if (!crashing_ && crash_.load(std::memory_order_relaxed)) {
    crashing_ = true;
    crash_since_ = number;
    chain_.raiseFromOutside(Fault::kProgramTrouble);
  }
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
  // device
  const DeviceRead read = device_.read(reading_);
  const std::int64_t read_ns = clock_.nowNs();
  if (read == DeviceRead::kFinished) {
    stats_.end = ServoEnd::kDeviceFinished;
    return false;
  }

  // tool → gate → engine → gate
  hearOthers(number);
  const GuardedWrench guarded =
      chain_.tick(reading_, read == DeviceRead::kFresh, elapsed_ticks, closingShare(number), chain_tick_);
  const std::int64_t computed_ns = clock_.nowNs();
  device_.write(guarded);
  const std::int64_t wrote_ns = clock_.nowNs();

  const std::int64_t device_ns = (read_ns - began_ns) + (wrote_ns - computed_ns);
  record(due_ns, device_ns, computed_ns - read_ns);
  noteFault();
  const std::int64_t recorded_ns = clock_.nowNs();

  stats_.read.add(read_ns - began_ns);
  stats_.engine.add(computed_ns - read_ns);
  stats_.write.add(wrote_ns - computed_ns);
  stats_.record.add(recorded_ns - wrote_ns);
  stats_.device.add(device_ns);
  stats_.tick.add(recorded_ns - began_ns);

  stats_.end = endAfter(number);
  return stats_.end == ServoEnd::kNotYet;
}

void ServoLoop::record(std::int64_t due_ns, std::int64_t device_ns, std::int64_t engine_ns) noexcept {
  const GestureSample sample = sampleOf(chain_tick_, due_ns, device_ns, engine_ns);
  ++stats_.samples;
  for (std::uint32_t bits = sample.flags; bits != 0; bits &= bits - 1)
    ++stats_.flag_ticks[static_cast<std::size_t>(std::countr_zero(bits))];
  // a full ring counts what it refuses; the loop never waits for anybody
  ring_.push(sample);
  latest_.publish(sample);
}

void ServoLoop::noteFault() noexcept {
  fault_.store(chain_tick_.fault, std::memory_order_relaxed);
  condition_.store(reading_.condition, std::memory_order_relaxed);
  if (chain_tick_.fault != Fault::kNone) ++stats_.fault_ticks;
  const std::uint64_t raised = chain_.gate().faultsRaised();
  if (raised == stats_.faults) return;
  if (stats_.faults == 0) stats_.first_fault = chain_tick_.fault;
  stats_.faults = raised;
  faults_.store(raised, std::memory_order_relaxed);
}

// is it over?
ServoEnd ServoLoop::endAfter(std::uint64_t number) noexcept {
  if (crashing_ && number - crash_since_ + 1 >= closing_ticks_) return ServoEnd::kCrash;
  if (chain_tick_.fault != Fault::kNone && settings_.on_fault == FaultPolicy::kEnd) {
    if (fault_since_ == 0) fault_since_ = number + 1;
    return number + 1 - fault_since_ < after_fault_ticks_ ? ServoEnd::kNotYet : ServoEnd::kFault;
  }
  fault_since_ = 0;
  if (!closing_ || number - closing_since_ + 1 < closing_ticks_) return ServoEnd::kNotYet;
  return settings_.max_ticks > 0 && number + 1 >= settings_.max_ticks ? ServoEnd::kTicksDone
                                                                      : ServoEnd::kStopped;
}

}  // namespace needlelab
