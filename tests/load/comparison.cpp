#include "tests/load/comparison.h"

#include <cmath>
#include <utility>

namespace needlelab::test {
namespace {

// half a step, and the rounding of a double in a value of up to a metre
bool near(double made, double stored, double step) {
  if (std::isnan(made) || std::isnan(stored)) return std::isnan(made) && std::isnan(stored);
  return std::abs(made - stored) <= 0.5 * step + 1e-12;
}

template <std::size_t N>
bool near(const double (&made)[N], const double (&stored)[N], double step) {
  for (std::size_t i = 0; i < N; ++i)
    if (!near(made[i], stored[i], step)) return false;
  return true;
}

}  // namespace

void Difference::add(const Difference& other) {
  stored += other.stored;
  lost += other.lost;
  duplicated += other.duplicated;
  different += other.different;
  foreign += other.foreign;
  if (first.empty()) first = other.first;
}

const char* differingField(const GestureSample& made, const GestureSample& stored,
                           const Resolution& resolution) {
  const double step_ns = resolution.time_s * 1e9;
  if (made.tick != stored.tick) return "tick";
  if (made.time_ns != stored.time_ns) return "time_ns";
  if (!near(made.p_WT_m, stored.p_WT_m, resolution.length_m)) return "p_WT_m";
  if (!near(made.q_WT, stored.q_WT, resolution.quaternion)) return "q_WT";
  if (!near(made.speed_mps, stored.speed_mps, resolution.speed_mps)) return "speed_mps";
  if (!near(made.force_W_N, stored.force_W_N, resolution.force_N)) return "force_W_N";
  if (!near(made.torque_W_Nm, stored.torque_W_Nm, resolution.torque_Nm)) return "torque_W_Nm";
  if (!near(made.wall_W_m, stored.wall_W_m, resolution.length_m)) return "wall_W_m";
  if (!near(made.insertion_m, stored.insertion_m, resolution.length_m)) return "insertion_m";
  if (!near(made.lateral_error_m, stored.lateral_error_m, resolution.length_m)) return "lateral_error_m";
  if (!near(made.plunger, stored.plunger, resolution.quaternion)) return "plunger";
  if (!near(made.device_ns, stored.device_ns, step_ns)) return "device_ns";
  if (!near(made.engine_ns, stored.engine_ns, step_ns)) return "engine_ns";
  if (made.flags != stored.flags) return "flags";
  if (made.buttons != stored.buttons) return "buttons";
  if (made.layer != stored.layer) return "layer";
  if (made.phase != stored.phase) return "phase";
  if (made.fault != stored.fault) return "fault";
  return nullptr;
}

SessionComparison::SessionComparison(StationStream stream, std::uint64_t ticks, std::string name)
    : stream_(std::move(stream)), name_(std::move(name)), seen_(ticks) {}

void SessionComparison::fault(const std::string& what) {
  if (difference_.first.empty()) difference_.first = name_ + ": " + what;
}

void SessionComparison::take(std::span<const GestureSample> stored) {
  for (std::size_t i = 0; i < stored.size();) {
    ++difference_.stored;
    if (stored[i].tick >= seen_.size()) {
      ++difference_.foreign;
      fault("tick " + std::to_string(stored[i].tick) + " is stored and was never generated");
      ++i;
      continue;
    }
    // a stretch of consecutive ticks is generated at once
    std::size_t end = i + 1;
    while (end < stored.size() && stored[end].tick == stored[end - 1].tick + 1 &&
           stored[end].tick < seen_.size())
      ++end;
    made_.resize(end - i);
    stream_.fill(stored[i].tick, made_);
    difference_.stored += end - i - 1;
    for (std::size_t k = i; k < end; ++k) takeOne(made_[k - i], stored[k]);
    i = end;
  }
}

void SessionComparison::takeOne(const GestureSample& made, const GestureSample& stored) {
  const auto tick = [&] { return "tick " + std::to_string(stored.tick); };
  if (stored.time_ns != made.time_ns) {
    ++difference_.foreign;
    fault(tick() + " is stored with the time of another station or session: " +
          std::to_string(stored.time_ns) + ", not " + std::to_string(made.time_ns));
    return;
  }
  if (seen_[stored.tick]) {
    ++difference_.duplicated;
    fault(tick() + " is stored twice");
    return;
  }
  seen_[stored.tick] = true;
  if (const char* field = differingField(made, stored, Resolution::standard()); field != nullptr) {
    ++difference_.different;
    fault(tick() + " is stored with another " + field);
  }
}

Difference SessionComparison::finish() {
  for (std::size_t tick = 0; tick < seen_.size(); ++tick) {
    if (seen_[tick]) continue;
    ++difference_.lost;
    fault("tick " + std::to_string(tick) + " is not stored");
  }
  return difference_;
}

}  // namespace needlelab::test
