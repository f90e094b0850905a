#include "common/haptics/thermal_budget.h"

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

constexpr double kThermalWindow_s = 10;
constexpr double kBucket_s = 0.1;
constexpr double kThermalRecovery_s = 1;  // from nothing to the peak, when the motors have cooled

}  // namespace

ThermalBudget::ThermalBudget(double peak, double continuous, double period_s) noexcept
    : peak_(peak),
      budget_(continuous * continuous * kThermalWindow_s),
      period_s_(period_s),
      recovery_(peak * period_s / kThermalRecovery_s),
      allowed_(peak),
      // rounded up, so that the buckets cover the whole window at any rate
      ticks_per_bucket_(static_cast<std::int64_t>(std::ceil(kBucket_s / period_s - 1e-6))) {}

double ThermalBudget::allowed(double wanted) noexcept {
  const double before = allowed_;
  allowed_ = std::min(limitNow(wanted), before + recovery_);
  return allowed_;
}

double ThermalBudget::limitNow(double wanted) const noexcept {
  if (budget_ <= 0) return 0.0;
  // the bucket that has left the window is given back tick by tick: all at once it would be felt
  const double progress = static_cast<double>(ticks_in_bucket_) / static_cast<double>(ticks_per_bucket_);
  const double leaving = bucket_[(current_ + 1) % kBuckets];
  const double left = budget_ - (whole_ + bucket_[current_] + (1.0 - progress) * leaving);
  // what is left, spread over a whole window, covers it: nearly always
  if (wanted * wanted * kThermalWindow_s <= left) return peak_;

  // the magnitude that could be held for good from now on: until the bucket `back` is out of the window, it
  // and all younger ones count
  const double bucket_s = static_cast<double>(ticks_per_bucket_) * period_s_;
  double counted = 0, held_squared = peak_ * peak_;
  for (std::size_t back = 0; back < kBuckets - 1; ++back) {
    counted += bucket_[(current_ + kBuckets - back) % kBuckets];
    const double age_s = back == 0 ? 0.0 : (static_cast<double>(back) - 1 + progress) * bucket_s;
    const double until_s = kThermalWindow_s - age_s;
    if (until_s <= 0) break;
    held_squared = std::min(held_squared, (budget_ - counted) / until_s);
  }
  held_squared = std::max(0.0, held_squared);
  // and more than that for a while, the more the colder the motors are
  const double cold = std::max(0.0, left / budget_);
  return std::sqrt(held_squared + (peak_ * peak_ - held_squared) * (cold * cold * cold));
}

void ThermalBudget::spend(double magnitude) noexcept {
  bucket_[current_] += magnitude * magnitude * period_s_;
  if (++ticks_in_bucket_ < ticks_per_bucket_) return;
  ticks_in_bucket_ = 0;
  current_ = (current_ + 1) % kBuckets;
  bucket_[current_] = 0;
  // summed anew, so that no rounding is carried on for hours; all but the current one and the one that leaves
  whole_ = 0;
  for (std::size_t i = 2; i < kBuckets; ++i) whole_ += bucket_[(current_ + i) % kBuckets];
}

}  // namespace needlelab
