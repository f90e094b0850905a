#include "client/station/run/zero_force_loop.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <optional>
#include <thread>

#include "client/station/run/real_time.h"
#include "client/station/run/signals.h"

namespace needlelab {
namespace {

constexpr std::int64_t kFirstTickLead_ns = 2'000'000;
constexpr auto kMaintain = std::chrono::milliseconds(50);

bool isPose(const Pose& X) {
  return isFinite(X.p) && isFinite(X.q) && std::abs(std::sqrt(dot(X.q, X.q)) - 1) <= 1e-3;
}

}  // namespace

ZeroForceLoop::ZeroForceLoop(Device& device, TimeSource& clock, const ZeroForceSettings& settings)
    : device_(device),
      clock_(clock),
      settings_(settings),
      kept_(settings.max_ticks / settings.keep_every + 1) {}

void ZeroForceLoop::run() noexcept {
  const double period_ns = 1e9 / settings_.rate_hz;
  const std::int64_t start_ns = clock_.nowNs() + kFirstTickLead_ns;
  std::uint64_t number = 0;
  while (number < settings_.max_ticks && !stop_.load(std::memory_order_relaxed)) {
    const std::int64_t due_ns = start_ns + std::llround(static_cast<double>(number) * period_ns);
    clock_.sleepUntilNs(due_ns);
    const std::int64_t late_ns = clock_.nowNs() - due_ns;
    stats_.wakeup.add(late_ns);
    if (static_cast<double>(late_ns) >= period_ns) {
      const auto missed = std::min(static_cast<std::uint64_t>(static_cast<double>(late_ns) / period_ns),
                                   settings_.max_ticks - number);
      number += missed;
      stats_.missed += missed;
      device_.skip(missed);
      if (number >= settings_.max_ticks) break;
    }
    tick(number);
    if (stats_.device_finished) break;
    ++number;
    elapsed_ticks_.store(number, std::memory_order_relaxed);
  }
  stats_.ticks = number;
  // includes the last tick's period; otherwise one tick would look like a rate of 30 kHz
  const double elapsed_ns = static_cast<double>(clock_.nowNs() - start_ns);
  stats_.seconds = std::max(elapsed_ns, static_cast<double>(number) * period_ns) * 1e-9;
  device_.write(GuardedWrench{});
}

void ZeroForceLoop::tick(std::uint64_t number) noexcept {
  const std::int64_t from_ns = clock_.nowNs();
  const DeviceRead read = device_.read(reading_);
  if (read == DeviceRead::kFinished) {
    stats_.device_finished = true;
    return;
  }
  // most devices need a write after each read; always zero force
  device_.write(GuardedWrench{});
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
  stats_.least_plunger = std::min(stats_.least_plunger, reading_.plunger);
  stats_.greatest_plunger = std::max(stats_.greatest_plunger, reading_.plunger);
  stats_.greatest_speed_mps = std::max(stats_.greatest_speed_mps, reading_.speed_mps);
  const std::size_t count = kept_count_.load(std::memory_order_relaxed);
  if (stats_.fresh++ % settings_.keep_every == 0 && count < kept_.size()) {
    kept_[count] = {static_cast<double>(number) / settings_.rate_hz, reading_.X_WH, reading_.speed_mps};
    kept_count_.store(count + 1, std::memory_order_release);
  }
}

ZeroForceRun runZeroForceLoop(ZeroForceLoop& loop, Device& device, const RtOptions* real_time,
                              const sigset_t& stop_signals, const std::function<bool()>& progress) {
  ZeroForceRun run;
  std::optional<ShallowSleep> shallow_sleep;
  if (real_time != nullptr) {
    shallow_sleep.emplace();
    run.realtime = judgeMachine(*real_time);
    run.realtime.push_back(shallow_sleep->step());
    run.realtime.push_back(lockMemory());
  }
  std::vector<RtStep> thread_steps;
  std::atomic<bool> done{false};
  std::thread haptic([&] {
    if (real_time != nullptr) thread_steps = makeThreadRealTime(*real_time);
    loop.run();
    done.store(true, std::memory_order_release);
  });
  bool goes_on = true;
  while (!done.load(std::memory_order_acquire)) {
    const bool signal = signalWithin(stop_signals, kMaintain) != 0;
    run.stopped = run.stopped || signal;
    device.maintain();
    goes_on = goes_on && progress();
    if (run.stopped || !goes_on) loop.stop();
  }
  haptic.join();
  run.realtime.insert(run.realtime.end(), thread_steps.begin(), thread_steps.end());
  return run;
}

}  // namespace needlelab
