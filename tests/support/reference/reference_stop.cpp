#include "tests/support/reference/reference_stop.h"

#include <algorithm>
#include <cmath>

namespace needlelab::test {

ReferenceStop::ReferenceStop(const TrackingWallSpec& spec, double rate_hz, bool wall_relaxes, Defect planted)
    : spec_(spec),
      rate_hz_(rate_hz),
      period_s_(1.0 / rate_hz),
      wall_relaxes_(wall_relaxes),
      planted_(planted) {}

// "A duration of s seconds is max(1, floor(s·rate + 0.5)) ticks."
double ReferenceStop::inTicks(double duration_s) const {
  return std::max(1.0, std::floor(duration_s * rate_hz_ + 0.5));
}

void ReferenceStop::move(double by_m) {
  lo_ += by_m;
  hi_ += by_m;
}

// "it ends if |v| ≥ 2·v_stop, or if |z| ≥ z_min + 0.6 mm"; elsewhere the band
bool ReferenceStop::ends(double x_m, double z_m, double speed_mps, bool left_band) const {
  const double speeds = planted_ == Defect::kNoStopHysteresis ? 1 : 2;  // planted: the first
  if (std::abs(speed_mps) >= speeds * spec_.stop_speed_mps) return true;
  if (planted_ == Defect::kLiteralEq4 || planted_ == Defect::kRampIgnoresZ ||
      planted_ == Defect::kCreepThrough)
    return false;                                                                 // planted
  if (planted_ == Defect::kEndsByWay) return std::abs(x_m - begin_m_) >= 0.4e-3;  // planted
  return wall_relaxes_ ? std::abs(z_m) >= z_min_ + 0.6e-3 : left_band;
}

// "Stop", 1 to 4
void ReferenceStop::step(double x_m, double z_m, double speed_mps) {
  const double size = std::abs(speed_mps);
  ++ticks_;
  ++i_;
  lo_ = std::min(lo_, x_m);
  hi_ = std::max(hi_, x_m);
  ++quiet_;
  const bool left_band = hi_ - lo_ >= 0.34e-3;
  if (left_band) {
    inward_ = x_m == hi_;
    lo_ = hi_ = x_m;
    quiet_ = 0;
  }
  if (size >= 2.5 * spec_.stop_speed_mps && ticks_ >= inTicks(0.1)) armed_ = true;
  if (stopped_ && ends(x_m, z_m, speed_mps, left_band)) {
    stopped_ = false;
    slow_ = quiet_ = 0;
    lo_ = hi_ = x_m;
  } else if (stopped_) {
    z_min_ = std::min(z_min_, std::abs(z_m));
  } else {
    slow_ = size < spec_.stop_speed_mps ? slow_ + 1 : 0;
    if (slow_ > 0 && ((armed_ && slow_ >= inTicks(spec_.stop_dwell_s)) || quiet_ >= inTicks(0.8))) {
      stopped_ = true;
      armed_ = false;
      z_min_ = std::abs(z_m);
      i_ = 0;
      begin_m_ = x_m;
    }
  }
  const bool inserting = size >= spec_.stop_speed_mps ? speed_mps > 0 : inward_;
  phase_ = stopped_ ? Phase::kStopped : inserting ? Phase::kInserting : Phase::kWithdrawing;
}

// "Tracking wall", 2
double ReferenceStop::wallMove(double z_m, double rejection_m) {
  if (!stopped_) return 0;
  if (spec_.stop_mode == StopMode::kRamp) return ramp(z_m, rejection_m);
  if (i_ == 0) z0_ = std::abs(z_m);
  const double gap = std::max(0.0, std::abs(z_m) - std::max(rejection_m, spec_.relax_residual * z0_));
  return std::copysign(
      std::min(gap * (1 - std::exp(-period_s_ / spec_.relax_time_s)), 1.5 * spec_.stop_speed_mps * period_s_),
      z_m);
}

double ReferenceStop::ramp(double z_m, double rejection_m) {
  const double n = inTicks(spec_.stop_duration_s);
  const double g = std::max(0.0, std::abs(z_m) - rejection_m);
  if (planted_ == Defect::kLiteralEq4 || planted_ == Defect::kRampIgnoresZ) {  // planted
    if (i_ == 0) m_ = std::copysign(g / n, z_m);
    if (i_ >= n) return 0;
    return m_ * (planted_ == Defect::kLiteralEq4 ? i_ + 1 : 1.0);
  }
  if (i_ == 0) {
    m_ = g / n;
    left_ = 6 * g;
    ramp_ = true;
    since_closed_ = 0;
  }
  double most = 1.5 * spec_.stop_speed_mps * period_s_;
  if (planted_ == Defect::kRampWithoutCap) m_ = most = g;  // planted
  if (planted_ == Defect::kCreepThrough) {                 // planted
    m_ = std::max(m_, g / n);
    return std::copysign(std::min({m_, g, most}), z_m);
  }
  double d = std::min(g, 0.12e-3 * period_s_);
  if (ramp_) {
    d = std::min({m_, g, most});
    left_ -= d;
    if (d == g || since_closed_ > 0) ++since_closed_;
    ramp_ = left_ > 0 && since_closed_ < inTicks(spec_.stop_dwell_s);
  }
  return std::copysign(d, z_m);
}

}  // namespace needlelab::test
