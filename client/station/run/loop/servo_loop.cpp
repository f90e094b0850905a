#include "client/station/run/loop/servo_loop.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "client/station/run/loop/real_time.h"

namespace needlelab {
namespace {

constexpr double kClosing_s = 0.02;     // duration of the fade-out before an end
constexpr double kAfterFault_s = 0.05;  // long enough for the gate's ramp to zero to be rendered and recorded
constexpr std::int64_t kLead_ns = 2'000'000;  // between the call of run and the first tick

}  // namespace

ServoLoop::ServoLoop(const SceneModel& model, Device& device, TimeSource& clock, SampleRing& ring,
                     const ServoSettings& settings, PathMaker* paths)
    : device_(device),
      clock_(clock),
      ring_(ring),
      settings_(settings),
      period_ns_(1e9 / settings.rate_hz),
      closing_ticks_(ticksIn(kClosing_s, settings.rate_hz)),
      after_fault_ticks_(ticksIn(kAfterFault_s, settings.rate_hz)),
      end_tick_(settings.max_ticks),
      chain_(model, device.info(), settings.X_HT, settings.plunger, paths),
      storm_(settings.rate_hz) {
  assert(settings.rate_hz > 0 && closing_ticks_ > 0);
  if (settings.passivity) chain_.controlPassivity(*settings.passivity);
  if (settings.starts_capped) chain_.beginCapped();
}

std::int64_t ServoLoop::dueNs(std::uint64_t tick) const noexcept {
  return start_ns_ + std::llround(static_cast<double>(tick) * period_ns_);
}

void ServoLoop::run() noexcept {
  start_ns_ = clock_.nowNs() + kLead_ns;
  std::uint64_t number = 0;
  for (;;) {
    TickTimes times;
    times.due_ns = dueNs(number);
    clock_.sleepUntilNs(times.due_ns);
    times.began_ns = clock_.nowNs();
    times.late_ns = times.began_ns - times.due_ns;
    times.missed = countMissedTicks(number, times.late_ns);
    if (times.missed > 0) {
      number += times.missed;
      times.due_ns = dueNs(number);
    }
    if (end_tick_ > 0 && number >= end_tick_) {
      stats_.ticks = stats_.samples + stats_.missed_ticks;
      stats_.end = stats_.ticks < end_tick_ ? ServoEnd::kDeviceFinished : ServoEnd::kTicksDone;
      break;
    }
    const bool goes_on = tick(number, times);
    stats_.ticks = stats_.samples + stats_.missed_ticks;
    if (!goes_on) break;
    ++number;
  }
  stats_.fault = chain_.gate().fault();
  device_.write(GuardedWrench{});
  if (settings_.black_box != nullptr) settings_.black_box->finish();
  ended_.store(true, std::memory_order_release);
}

// Returns the number of ticks that passed before the loop woke; the tick number skips them. Counts only those
// before the end of the lesson and of the device's motion.
std::uint64_t ServoLoop::countMissedTicks(std::uint64_t number, std::int64_t late_ns) noexcept {
  stats_.wakeup.add(late_ns);
  if (static_cast<double>(late_ns) < period_ns_) return 0;
  const auto missed = static_cast<std::uint64_t>(static_cast<double>(late_ns) / period_ns_);
  ++stats_.late_wakeups;
  assert(end_tick_ == 0 || number <= end_tick_);
  const std::uint64_t of_lesson = end_tick_ > 0 ? std::min(missed, end_tick_ - number) : missed;
  stats_.missed_ticks += device_.skip(of_lesson);
  missed_.store(stats_.missed_ticks, std::memory_order_relaxed);
  return missed;
}

// handles other threads' requests since the last tick
void ServoLoop::handleRequests(std::uint64_t number) noexcept {
  if (acknowledged_.load(std::memory_order_relaxed)) {
    acknowledged_.store(false, std::memory_order_relaxed);
    chain_.acknowledge();
  }
  if (switches_cap_.load(std::memory_order_relaxed)) {
    switches_cap_.store(false, std::memory_order_relaxed);
    chain_.switchCap();
  }
  if (!crashing_ && crash_.load(std::memory_order_relaxed)) {
    crashing_ = true;
    crash_since_ = number;
    chain_.raiseFromOutside(Fault::kProgramTrouble);
  }
}

// 1 during the lesson; falls to 0 over the last ticks before a planned end
double ServoLoop::closingShare(std::uint64_t number) noexcept {
  if (!closing_) {
    const bool last_ticks = end_tick_ > 0 && number + closing_ticks_ >= end_tick_;
    if (!last_ticks && !stop_.load(std::memory_order_relaxed)) return 1;
    closing_ = true;
    closing_since_ = number;
  }
  assert(number >= closing_since_);
  const std::uint64_t done = std::min(number - closing_since_ + 1, closing_ticks_);
  return 1 - static_cast<double>(done) / static_cast<double>(closing_ticks_);
}

bool ServoLoop::tick(std::uint64_t number, TickTimes& times) noexcept {
  // device
  const DeviceRead read = device_.read(reading_);
  times.read_ns = clock_.nowNs();
  if (read == DeviceRead::kFinished) {
    stats_.end = ServoEnd::kDeviceFinished;
    return false;
  }

  // tool → gate → engine → gate → device
  handleRequests(number);
  const auto elapsed_ticks = static_cast<std::int64_t>(times.missed) + 1;
  const GuardedWrench guarded =
      chain_.tick(reading_, read == DeviceRead::kFresh, elapsed_ticks, closingShare(number), chain_tick_);
  assert(chain_tick_.tick == number && "chain and loop count the same ticks");
  times.computed_ns = clock_.nowNs();
  device_.write(guarded);
  times.wrote_ns = clock_.nowNs();

  record(read, times);
  stats_.end = endAfter(number);
  return stats_.end == ServoEnd::kNotYet;
}

// checks for the end
ServoEnd ServoLoop::endAfter(std::uint64_t number) noexcept {
  assert(!crashing_ || number >= crash_since_);
  if (crashing_ && number - crash_since_ + 1 >= closing_ticks_) return ServoEnd::kCrash;
  if (chain_tick_.fault != Fault::kNone && settings_.on_fault == FaultPolicy::kEnd) {
    if (fault_since_ == 0) fault_since_ = number + 1;
    return number + 1 - fault_since_ < after_fault_ticks_ ? ServoEnd::kNotYet : ServoEnd::kFault;
  }
  fault_since_ = 0;
  if (!closing_ || number - closing_since_ + 1 < closing_ticks_) return ServoEnd::kNotYet;
  return end_tick_ > 0 && number + 1 >= end_tick_ ? ServoEnd::kTicksDone : ServoEnd::kStopped;
}

void ServoLoop::record(DeviceRead read, TickTimes& times) noexcept {
  publish(times);
  const bool raised = noteFault();
  BlackBoxTick* kept = nullptr;
  if (settings_.black_box != nullptr) {
    kept = &settings_.black_box->next();
    fill(*kept, read, times);
    if (raised) settings_.black_box->trigger(BlackBoxCause::kFault, chain_tick_.fault, chain_tick_.tick);
    if (storm_.note(times.missed))
      settings_.black_box->trigger(BlackBoxCause::kMissedTicks, chain_tick_.fault, chain_tick_.tick);
  }
  times.recorded_ns = clock_.nowNs();
  if (kept != nullptr) {
    kept->record_ns = times.recorded_ns - times.wrote_ns;
    settings_.black_box->commit();
  }

  stats_.read.add(times.read_ns - times.began_ns);
  stats_.engine.add(times.engine_ns());
  stats_.write.add(times.wrote_ns - times.computed_ns);
  stats_.record.add(times.recorded_ns - times.wrote_ns);
  stats_.device.add(times.device_ns());
  stats_.tick.add(times.recorded_ns - times.began_ns);
}

void ServoLoop::publish(const TickTimes& times) noexcept {
  const GestureSample sample = sampleOf(chain_tick_, times.due_ns, times.device_ns(), times.engine_ns());
  ++stats_.samples;
  for (std::uint32_t bits = sample.flags; bits != 0; bits &= bits - 1)
    ++stats_.flag_ticks[static_cast<std::size_t>(std::countr_zero(bits))];
  // a full ring counts refused samples; the loop never waits for other threads
  ring_.push(sample);
  if (after_contact_.load(std::memory_order_relaxed) == 0) noteContact(sample);
  latest_.publish(sample);
}

// the time limit begins here
void ServoLoop::noteContact(const GestureSample& sample) noexcept {
  if (sample.layer < 0 || (sample.flags & kFlagCapped) != 0) return;
  after_contact_.store(sample.tick + 1, std::memory_order_relaxed);
  if (settings_.needle_ticks == 0) return;
  const std::uint64_t end = sample.tick + settings_.needle_ticks + 2;
  end_tick_ = end_tick_ > 0 ? std::min(end_tick_, end) : end;
}

// returns true if the gate raised a fault in this tick
bool ServoLoop::noteFault() noexcept {
  fault_.store(chain_tick_.fault, std::memory_order_relaxed);
  condition_.store(reading_.condition, std::memory_order_relaxed);
  const ForceGate& gate = chain_.gate();
  cause_lasts_.store(gate.causeLasts(), std::memory_order_relaxed);
  is_acknowledged_.store(gate.acknowledged(), std::memory_order_relaxed);
  if (chain_tick_.fault != Fault::kNone) ++stats_.fault_ticks;
  const std::uint64_t raised = gate.faultsRaised();
  assert(raised >= stats_.faults);
  stats_.noteFault(chain_tick_.fault, raised != stats_.faults, chain_tick_.tick);
  if (raised == stats_.faults) return false;
  if (stats_.faults == 0) stats_.first_fault = chain_tick_.fault;
  stats_.faults = raised;
  faults_.store(raised, std::memory_order_relaxed);
  return true;
}

void ServoLoop::fill(BlackBoxTick& kept, DeviceRead read, const TickTimes& times) const noexcept {
  const StepReport& report = chain_tick_.report;
  kept.tick = chain_tick_.tick;
  kept.missed_before = times.missed;
  kept.due_ns = times.due_ns;
  kept.late_ns = times.late_ns;
  kept.read_ns = times.read_ns - times.began_ns;
  kept.engine_ns = times.engine_ns();
  kept.write_ns = times.wrote_ns - times.computed_ns;
  kept.reading = reading_;
  kept.fresh = read == DeviceRead::kFresh;
  kept.X_WT = chain_tick_.X_WT;
  kept.wanted_W = report.wrench_W;
  kept.rendered_W = chain_tick_.rendered_W;
  kept.depth_m = report.depth_m;
  kept.insertion_m = report.insertion_m;
  kept.speed_mps = report.speed_mps;
  kept.flags = report.flags | chain_tick_.gate_flags;
  kept.layer = static_cast<std::int8_t>(report.layer);
  kept.phase = static_cast<std::uint8_t>(report.phase);
  kept.fault = static_cast<std::uint8_t>(chain_tick_.fault);
}

}  // namespace needlelab
