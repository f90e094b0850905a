#include "common/gesture/thinning.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

namespace needlelab {
namespace {

/// The numbers of a sample that are averaged separately.
constexpr std::size_t kMeans = 16;
std::array<double*, kMeans> meansOf(GestureSample& s) {
  return {&s.p_WT_m[0],      &s.p_WT_m[1],      &s.p_WT_m[2],       &s.speed_mps,
          &s.force_W_N[0],   &s.force_W_N[1],   &s.force_W_N[2],    &s.torque_W_Nm[0],
          &s.torque_W_Nm[1], &s.torque_W_Nm[2], &s.wall_W_m[0],     &s.wall_W_m[1],
          &s.wall_W_m[2],    &s.insertion_m,    &s.lateral_error_m, &s.plunger};
}
std::array<double, kMeans> valuesOf(GestureSample s) {
  std::array<double, kMeans> values{};
  const auto places = meansOf(s);
  for (std::size_t i = 0; i < kMeans; ++i) values[i] = *places[i];
  return values;
}

/// Ticks from b to a; negative if a is before b.
double ticksBetween(std::uint64_t a, std::uint64_t b) {
  return a >= b ? static_cast<double>(a - b) : -static_cast<double>(b - a);
}

/// Collects the values of the samples between two kept samples.
void join(GestureSample& group, const GestureSample& sample) {
  group.flags |= sample.flags;
  group.buttons |= sample.buttons;
  group.device_ns = std::max(group.device_ns, sample.device_ns);
  group.engine_ns = std::max(group.engine_ns, sample.engine_ns);
  if (sample.fault != 0) group.fault = sample.fault;
}

}  // namespace

Thinner::Thinner(double rate_hz, double target_hz) : step_ticks_(std::max(1.0, rate_hz / target_hz)) {
  assert(rate_hz > 0 && target_hz > 0);
}

void Thinner::startGrid(const GestureSample& first) {
  window_.clear();
  first_tick_ = first.tick;
  due_ = 0;
  group_.reset();
}

void Thinner::keep(const GestureSample& sample, bool exact) {
  Center center{sample, exact};
  if (group_) {
    join(*group_, sample);
    center.sample.flags = group_->flags;
    center.sample.buttons = group_->buttons;
    center.sample.device_ns = group_->device_ns;
    center.sample.engine_ns = group_->engine_ns;
    center.sample.fault = group_->fault;
  }
  group_.reset();
  centers_.push_back(center);
}

void Thinner::add(const GestureSample& sample, std::vector<GestureSample>& out) {
  if (!window_.empty() && sample.tick <= window_.back().tick) finish(out);
  const bool first = window_.empty();
  if (first) startGrid(sample);
  window_.push_back(sample);
  const double at = ticksBetween(sample.tick, first_tick_);
  if (at >= due_) {
    keep(sample, first);
    // after a gap the grid continues at its next point
    due_ = step_ticks_ * (std::floor(at / step_ticks_) + 1);
    if (due_ <= at) due_ += step_ticks_;
  } else if (group_) {
    join(*group_, sample);
  } else {
    group_ = sample;
  }
  settle(out, false);
}

void Thinner::finish(std::vector<GestureSample>& out) {
  if (!window_.empty()) {
    const GestureSample& last = window_.back();
    if (!centers_.empty() && centers_.back().sample.tick == last.tick) {
      centers_.back().exact = true;
    } else if (group_) {
      keep(last, true);
    }
  }
  settle(out, true);
  window_.clear();
  group_.reset();
}

void Thinner::settle(std::vector<GestureSample>& out, bool all) {
  if (window_.empty()) return;
  const std::uint64_t newest = window_.back().tick;
  std::size_t done = 0;
  while (done < centers_.size() && (all || ticksBetween(newest, centers_[done].sample.tick) >= step_ticks_)) {
    out.push_back(meanAround(centers_[done]));
    ++done;
  }
  centers_.erase(centers_.begin(), centers_.begin() + static_cast<std::ptrdiff_t>(done));
  // no pending sample needs older samples than this
  const double needed =
      (centers_.empty() ? due_ : ticksBetween(centers_.front().sample.tick, first_tick_)) - step_ticks_;
  // binary search: at a low rate the window holds thousands of samples, and this runs for every sample
  const auto keep_from =
      std::partition_point(window_.begin(), window_.end() - 1, [&](const GestureSample& s) {
        ++steps_;
        return ticksBetween(s.tick, first_tick_) <= needed;
      });
  // move in large batches, so that the cost per sample is negligible
  if (static_cast<double>(keep_from - window_.begin()) >= step_ticks_) {
    steps_ += static_cast<std::uint64_t>(window_.end() - keep_from);
    window_.erase(window_.begin(), keep_from);
  }
}

GestureSample Thinner::meanAround(const Center& center) {
  GestureSample mean = center.sample;
  if (center.exact || step_ticks_ <= 1) return mean;
  const auto own = valuesOf(center.sample);
  std::array<double, kMeans> sums{}, weights{};
  std::array<double, 4> q{};
  const auto from = std::partition_point(window_.begin(), window_.end(), [&](const GestureSample& s) {
    ++steps_;
    return ticksBetween(center.sample.tick, s.tick) >= step_ticks_;
  });
  for (auto s = from; s != window_.end(); ++s) {
    ++steps_;
    const double weight = 1 - std::abs(ticksBetween(s->tick, center.sample.tick)) / step_ticks_;
    if (weight <= 0) break;
    const auto values = valuesOf(*s);
    for (std::size_t i = 0; i < kMeans; ++i) {
      // NaN ("no wall") neither counts nor spreads
      if (!std::isfinite(values[i])) continue;
      sums[i] += weight * values[i];
      weights[i] += weight;
    }
    // of an orientation's two quaternions, take the one on the centre's side
    double dot = 0;
    for (std::size_t i = 0; i < 4; ++i) dot += s->q_WT[i] * center.sample.q_WT[i];
    for (std::size_t i = 0; i < 4; ++i) q[i] += (dot < 0 ? -weight : weight) * s->q_WT[i];
  }
  const auto places = meansOf(mean);
  for (std::size_t i = 0; i < kMeans; ++i) {
    if (std::isfinite(own[i]) && weights[i] > 0) *places[i] = sums[i] / weights[i];
  }
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (std::isfinite(length) && length > 1e-9) {
    for (std::size_t i = 0; i < 4; ++i) mean.q_WT[i] = q[i] / length;
  }
  return mean;
}

Resolution coarser(const Resolution& resolution, double factor) {
  const auto step = [factor](double value) { return std::min(1.0, value * factor); };
  return {step(resolution.length_m),  step(resolution.quaternion), step(resolution.force_N),
          step(resolution.torque_Nm), step(resolution.time_s),     step(resolution.speed_mps)};
}

}  // namespace needlelab
