#include "tests/unit/client/device/world/world_run.h"

#include <fmt/core.h>

#include <bit>

#include "tests/support/scenes/scenes.h"

namespace needlelab::test {

WorldRun::WorldRun(const LessonPlan& plan, double gate_rate_hz)
    : world(plan.seed),
      random_(plan.seed ^ 0x5EED),
      model_(*compile(plan.six_layers ? paperSixLayers() : paperOneDof(), gate_rate_hz)) {
  lateBy("haptic", plan.tick_late_ns);
}

void WorldRun::useDevice(Device& device, std::function<void()> on_tick) {
  device_ = &device;
  haptic = std::make_unique<HapticThread>(world, device, model_);
  haptic->on_tick = std::move(on_tick);
  rules_ =
      std::make_unique<GateRules>(device.info().limits, [this](const std::string& what) { breakRule(what); });
}

void WorldRun::breakRule(const std::string& what) {
  if (broken_.empty()) broken_ = fmt::format("at {:.3f} ms: {}", 1e-6 * static_cast<double>(now()), what);
}

void WorldRun::fold(std::uint64_t value) {
  trace_ = (trace_ ^ value) * 0x100000001b3ull;
}

void WorldRun::lateBy(const std::string& thread, std::int64_t max_ns) {
  world.wakeLate(thread, [this, max_ns] { return random_.upTo(max_ns); });
}

void WorldRun::watchTick() {
  ++ticks_;
  fold(static_cast<std::uint64_t>(now()));
  fold(std::bit_cast<std::uint64_t>(haptic->force_N()));
  fold(haptic->reading().condition);
  fold(static_cast<std::uint64_t>(haptic->gate().fault()));
  rules_->check(*haptic);
}

void WorldRun::acknowledgeAsPlanned(const LessonPlan& plan) {
  if (plan.acknowledged_every_ns == 0) return;
  const std::int64_t start_ns = now();
  for (std::int64_t at = 0; at < plan.lasts_ns; at += plan.acknowledged_every_ns)
    world.at(start_ns + at, [this] { acknowledge(); });
}

void WorldRun::recoverWithin(std::int64_t max_ns, const std::function<bool()>& is_good) {
  const std::int64_t last_ns = now() + max_ns;
  int good_ticks = 0;
  while (good_ticks < 10 && now() < last_ns && broken_.empty()) {
    acknowledge();
    world.sleepForNs(kMs);
    good_ticks = haptic->gate().fault() == Fault::kNone && is_good() ? good_ticks + 1 : 0;
  }
  if (good_ticks < 10)
    breakRule(fmt::format("no recovery within {} ms: fault '{}', condition {:#x}, status '{}'", max_ns / kMs,
                          faultText(haptic->gate().fault()), haptic->reading().condition, device_->status()));
}

}  // namespace needlelab::test
