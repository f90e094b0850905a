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

// "it ends if |v| ≥ 2·v_stop, … or if |z| ≥ z_min + 0.6 mm"; elsewhere the band
bool ReferenceStop::ends(double x_m, double z_m, double speed_mps, bool left_band) const {
  const double speeds = planted_ == Defect::kNoStopHysteresis ? 1 : 2;  // planted: the first
  if (std::abs(speed_mps) >= speeds * spec_.stop_speed_mps) return true;
  if (planted_ == Defect::kLiteralEq4 || planted_ == Defect::kRampIgnoresZ ||
      planted_ == Defect::kCreepThrough)
    return false;                                                                 // planted
  if (planted_ == Defect::kEndsByWay) return std::abs(x_m - begin_m_) >= 0.4e-3;  // planted
  return wall_relaxes_ ? std::abs(z_m) >= z_min_ + 0.6e-3 : left_band;
}

// "Across": the first slow tick after one that was fast, ended a stop or moved across sets the place
bool ReferenceStop::movesAcross(Vec3 p_W_m, Vec3 u_W, bool slow) {
  const bool first = slow && !slow_before_;
  slow_before_ = slow;
  ++across_ticks_;
  if (!slow) return false;
  const Vec3 off = p_W_m - across_from_W_m_;
  if (!first && norm(off - u_W * dot(off, u_W)) < 0.34e-3) return false;
  const bool moves = !first && across_ticks_ <= inTicks(0.1);
  across_from_W_m_ = p_W_m;
  across_ticks_ = 0;
  return moves && planted_ != Defect::kRestsAcross;  // planted: never
}

// "Stop", 1 to 5
void ReferenceStop::step(double x_m, double z_m, double speed_mps, Vec3 p_W_m, Vec3 u_W) {
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
  const bool across = movesAcross(p_W_m, u_W, stopped_ || size < spec_.stop_speed_mps);
  if (stopped_ && (ends(x_m, z_m, speed_mps, left_band) || across)) {
    stopped_ = slow_before_ = false;
    slow_ = quiet_ = 0;
    lo_ = hi_ = x_m;
  } else if (stopped_) {
    z_min_ = std::min(z_min_, std::abs(z_m));
  } else if (across) {
    slow_ = quiet_ = 0;
    slow_before_ = false;
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
double ReferenceStop::move(Wall& wall, double z_m, double rest_m) const {
  if (!stopped_) return 0;
  if (spec_.stop_mode == StopMode::kRamp) return ramp(wall, z_m, rest_m);
  if (i_ == 0) wall.z0 = std::abs(z_m);
  const double gap = std::max(0.0, std::abs(z_m) - std::max(rest_m, spec_.relax_residual * wall.z0));
  return std::copysign(
      std::min(gap * (1 - std::exp(-period_s_ / spec_.relax_time_s)), 1.5 * spec_.stop_speed_mps * period_s_),
      z_m);
}

double ReferenceStop::ramp(Wall& wall, double z_m, double rest_m) const {
  const double n = inTicks(spec_.stop_duration_s);
  const double g = std::max(0.0, std::abs(z_m) - rest_m);
  if (planted_ == Defect::kLiteralEq4 || planted_ == Defect::kRampIgnoresZ) {  // planted
    if (i_ == 0) wall.m = std::copysign(g / n, z_m);
    if (i_ >= n) return 0;
    return wall.m * (planted_ == Defect::kLiteralEq4 ? i_ + 1 : 1.0);
  }
  if (i_ == 0) wall = {g > 1e-9, 0, g / n, 6 * g, 0};
  double most = 1.5 * spec_.stop_speed_mps * period_s_;
  if (planted_ == Defect::kRampWithoutCap) wall.m = most = g;  // planted
  if (planted_ == Defect::kCreepThrough) {                     // planted
    wall.m = std::max(wall.m, g / n);
    return std::copysign(std::min({wall.m, g, most}), z_m);
  }
  double d = std::min(g, 0.12e-3 * period_s_);
  if (wall.ramp) {
    d = std::min({wall.m, g, most});
    wall.left -= d;
    if (d == g || wall.since_closed > 0) ++wall.since_closed;
    wall.ramp = wall.left > 0 && wall.since_closed < inTicks(spec_.stop_dwell_s);
  }
  return std::copysign(d, z_m);
}

}  // namespace needlelab::test
