#include "tests/unit/client/device/world/virtuose_plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "client/device/virtuose/virtuose_errors.h"

namespace needlelab::test {
namespace {

// calls that may fail, and their error codes
constexpr const char* kMayFail[] = {"virtGetPosition",      "virtGetSpeed",   "virtGetDeadMan",
                                    "virtGetEmergencyStop", "virtGetPowerOn", "virtGetAlarm",
                                    "virtGetFailure",       "virtSetForce"};
constexpr int kCodes[] = {kVirtHardwareError, kVirtPositionDiscontinuity, kVirtCallTime, kVirtCommunication};

}  // namespace

const VirtuoseTroubleRow& rowOf(VirtuoseTrouble trouble) {
  static constexpr VirtuoseTroubleRow kRows[kVirtuoseTroubles] = {
      {"haptic thread hangs", "", ""},
      {"link down", "link_down {lasts_s}", ""},
      {"service stopped", "daemon 0", "daemon 1"},
      {"slow", "slow {milli}", "slow {answer_s}"},
      {"handle released", "dead_man 0", "dead_man 1"},
      {"emergency stop", "estop press", "estop free;switch 1"},
      {"switched off", "switch 0", "switch 1"},
      {"overheated", "overheat 1", "overheat 0"},
      {"failure", "failure 1", "failure 0"},
      {"refused", "", ""},
      {"bad turn", "bad_turn 1.1", "bad_turn 1"},
      {"handle jumps", "jump 0 0 -{milli}", ""},
      {"button", "button {amount} 1", "button {amount} 0"},
  };
  return kRows[static_cast<std::size_t>(trouble)];
}

RefusedCall refusedCall(int amount) {
  const auto n = static_cast<std::size_t>(amount);
  return {kMayFail[n / std::size(kCodes)], kCodes[n % std::size(kCodes)]};
}

VirtuosePlan virtuosePlanOf(std::uint64_t seed) {
  Random random(seed);
  VirtuosePlan plan;
  plan.seed = seed;
  const bool is_calm = random.chance(0.2);
  plan.tick_late_ns = is_calm ? 0 : random.upTo(random.chance(0.2) ? 3 * kMs : kMs / 2);
  plan.keeper_late_ns = is_calm ? 0 : random.upTo(5 * kMs);
  plan.answer_ns = random.chance(0.5) ? random.upTo(kMs / 5) : 0;
  plan.prepare_ns = random.chance(0.1) ? 2'100 * kMs + random.upTo(600 * kMs) : random.upTo(30 * kMs);
  plan.lasts_ns = 100 * kMs + random.upTo(300 * kMs);
  plan.acknowledged_every_ns = random.chance(0.7) ? 20 * kMs + random.upTo(100 * kMs) : 0;
  plan.stroke_s = random.in(0.3, 1.0);
  plan.deepest_m = random.in(0.005, 0.025);
  plan.six_layers = random.chance(0.5);
  plan.ends_in_trouble = random.chance(0.1);
  for (std::uint64_t left = random.below(5); left > 0; --left) {
    PlannedVirtuoseTrouble trouble{static_cast<VirtuoseTrouble>(random.below(kVirtuoseTroubles)),
                                   random.upTo(plan.lasts_ns), random.upTo(150 * kMs)};
    switch (trouble.what) {
      case VirtuoseTrouble::kHapticHangs:
        if (random.chance(0.1)) trouble.lasts_ns = 2'000 * kMs + random.upTo(300 * kMs);
        break;
      case VirtuoseTrouble::kLinkDown:
      case VirtuoseTrouble::kServiceStopped:
        if (random.chance(0.2)) trouble.lasts_ns = random.upTo(1'200 * kMs);
        break;
      case VirtuoseTrouble::kSlow:
        trouble.amount = random.chance(0.3) ? 60 : static_cast<int>(1 + random.below(45));
        break;
      case VirtuoseTrouble::kBadTurn:
        trouble.lasts_ns = random.upTo(12 * kMs);
        break;
      case VirtuoseTrouble::kRefused:
        trouble.amount = static_cast<int>(random.below(std::size(kMayFail) * std::size(kCodes)));
        if (random.chance(0.2)) trouble.lasts_ns = 1'000 * kMs + random.upTo(200 * kMs);
        break;
      case VirtuoseTrouble::kJump:
        trouble.amount = static_cast<int>(1 + random.below(20));
        break;
      case VirtuoseTrouble::kButton:
        trouble.amount = static_cast<int>(1 + random.below(3));
        break;
      default:
        break;
    }
    plan.lasts_ns = std::max(plan.lasts_ns, trouble.at_ns + trouble.lasts_ns);
    plan.troubles.push_back(trouble);
  }
  return plan;
}

std::string textOf(const VirtuosePlan& plan) {
  const auto inMs = [](std::int64_t ns) { return 1e-6 * static_cast<double>(ns); };
  std::string text = fmt::format(
      "{:.0f} ms after {:.0f} ms of preparation, ticks late by up to {:.2f} ms, keeper by {:.2f} ms, calls "
      "take {:.2f} ms",
      inMs(plan.lasts_ns), inMs(plan.prepare_ns), inMs(plan.tick_late_ns), inMs(plan.keeper_late_ns),
      inMs(plan.answer_ns));
  for (const PlannedVirtuoseTrouble& trouble : plan.troubles)
    text += fmt::format("; at {:.1f} ms for {:.1f} ms: {} ({})", inMs(trouble.at_ns), inMs(trouble.lasts_ns),
                        rowOf(trouble.what).name, trouble.amount);
  if (plan.ends_in_trouble) text += "; closed as it is";
  return text;
}

}  // namespace needlelab::test
