#include "client/station/run/loop/zero_force_loop.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "client/station/run/loop/real_time.h"
#include "client/station/run/loop/signals.h"

namespace needlelab {
namespace {

constexpr std::int64_t kFirstTickLead_ns = 2'000'000;
constexpr auto kMaintain = std::chrono::milliseconds(50);

bool isPose(const Pose& X) {
  return isFinite(X.p) && isFinite(X.q) && std::abs(std::sqrt(dot(X.q, X.q)) - 1) <= 1e-3;
}

/// The loop on the haptic thread, which first becomes a real-time thread as in a lesson.
class HapticTurns final : public Turns {
 public:
  HapticTurns(ZeroForceLoop& loop, const RtOptions* real_time) : loop_(loop), real_time_(real_time) {}
  std::optional<std::int64_t> turn() noexcept override {
    if (!std::exchange(begun_, true) && real_time_ != nullptr) steps_ = makeThreadRealTime(*real_time_);
    const auto due_ns = loop_.turn();
    if (!due_ns) ended_.store(true, std::memory_order_release);
    return due_ns;
  }
  void rest(std::int64_t until_ns) noexcept override { loop_.rest(until_ns); }

  [[nodiscard]] bool ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// The thread's real-time steps; read them after `ended`.
  [[nodiscard]] const std::vector<RtStep>& steps() const noexcept { return steps_; }

 private:
  ZeroForceLoop& loop_;
  const RtOptions* real_time_;
  std::vector<RtStep> steps_;
  bool begun_ = false;
  std::atomic<bool> ended_{false};
};

}  // namespace

ZeroForceLoop::ZeroForceLoop(Device& device, TimeSource& clock, const ZeroForceSettings& settings)
    : device_(device),
      clock_(clock),
      settings_(settings),
      period_ns_(1e9 / settings.rate_hz),
      kept_(settings.max_ticks / settings.keep_every + 1) {}

void ZeroForceLoop::run() noexcept {
  while (const auto due_ns = turn()) rest(*due_ns);
}

std::int64_t ZeroForceLoop::dueNs() const noexcept {
  return start_ns_ + std::llround(static_cast<double>(number_) * period_ns_);
}

std::optional<std::int64_t> ZeroForceLoop::turn() noexcept {
  if (std::exchange(begun_, true))
    wake();
  else
    start_ns_ = clock_.nowNs() + kFirstTickLead_ns;
  const bool over = stats_.device_finished || number_ >= settings_.max_ticks;
  if (!over && !stop_.load(std::memory_order_relaxed)) return dueNs();
  stats_.ticks = number_;
  // includes the last tick's period; otherwise one tick would look like a rate of 30 kHz
  const double elapsed_ns = static_cast<double>(clock_.nowNs() - start_ns_);
  stats_.seconds = std::max(elapsed_ns, static_cast<double>(number_) * period_ns_) * 1e-9;
  device_.write(GuardedWrench{});
  return std::nullopt;
}

// runs the tick that is due; skips those that passed before the loop woke
void ZeroForceLoop::wake() noexcept {
  const std::int64_t late_ns = clock_.nowNs() - dueNs();
  stats_.wakeup.add(late_ns);
  if (static_cast<double>(late_ns) >= period_ns_) {
    const auto missed = std::min(static_cast<std::uint64_t>(static_cast<double>(late_ns) / period_ns_),
                                 settings_.max_ticks - number_);
    number_ += missed;
    stats_.missed += missed;
    device_.skip(missed);
    if (number_ >= settings_.max_ticks) return;
  }
  tick(number_);
  if (stats_.device_finished) return;
  ++number_;
  elapsed_ticks_.store(number_, std::memory_order_relaxed);
}

void ZeroForceLoop::tick(std::uint64_t number) noexcept {
  const std::int64_t from_ns = clock_.nowNs();
  const DeviceRead read = device_.read(reading_);
  if (read == DeviceRead::kFinished) {
    stats_.device_finished = true;
    return;
  }
  device_.write(answer(number, read, reading_));  // most devices need a write after each read
  stats_.exchange.add(clock_.nowNs() - from_ns);

  ++stats_.ran;
  stats_.last_condition = reading_.condition;
  condition_.store(reading_.condition, std::memory_order_relaxed);
  for (std::uint32_t bits = reading_.condition; bits != 0; bits &= bits - 1)
    ++stats_.condition_ticks[static_cast<std::size_t>(std::countr_zero(bits))];
  if (read == DeviceRead::kFresh) {
    silence_ = 0;
    keep(number);
  } else {
    stats_.longest_silence = std::max(stats_.longest_silence, ++silence_);
  }
}

// handles a fresh reading
void ZeroForceLoop::keep(std::uint64_t number) noexcept {
  if (!isPose(reading_.X_WH)) {
    ++stats_.bad_poses;
    ++stats_.fresh;
    return;
  }
  stats_.buttons_seen |= reading_.buttons;
  stats_.min_plunger = std::min(stats_.min_plunger, reading_.plunger);
  stats_.greatest_plunger = std::max(stats_.greatest_plunger, reading_.plunger);
  stats_.greatest_speed_mps = std::max(stats_.greatest_speed_mps, reading_.speed_mps);
  const std::size_t count = kept_count_.load(std::memory_order_relaxed);
  if (stats_.fresh++ % settings_.keep_every == 0 && count < kept_.size()) {
    kept_[count] = {static_cast<double>(number) / settings_.rate_hz, reading_.X_WH, reading_.speed_mps};
    kept_count_.store(count + 1, std::memory_order_release);
  }
}

ZeroForceRun runZeroForceLoop(ZeroForceLoop& loop, Device& device, const RtOptions* real_time,
                              const sigset_t& stop_signals, const std::function<bool()>& progress,
                              TimeSource& time, TurnRunner& threads) {
  ZeroForceRun run;
  std::optional<ShallowSleep> shallow_sleep;
  if (real_time != nullptr) {
    shallow_sleep.emplace();
    run.realtime = judgeMachine(*real_time);
    run.realtime.push_back(shallow_sleep->step());
    run.realtime.push_back(lockMemory());
  }
  HapticTurns haptic(loop, real_time);
  {
    const auto running = threads.start(haptic, {"zero force", 0});
    bool goes_on = true;
    // at least once, because a loop faster than this thread also has something to report
    do {
      const bool signal = signalWithin(stop_signals, kMaintain, time) != 0;
      run.stopped = run.stopped || signal;
      device.maintain();
      goes_on = goes_on && progress();
      if (run.stopped || !goes_on) loop.stop();
    } while (!haptic.ended());
  }
  run.realtime.insert(run.realtime.end(), haptic.steps().begin(), haptic.steps().end());
  return run;
}

}  // namespace needlelab
