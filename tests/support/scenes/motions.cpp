#include "tests/support/scenes/motions.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/support/random.h"

namespace needlelab::test {
namespace {

// a wave of period 1 and amplitude 1 made of parabolas: close to a sine, without libm
double wave(double turns) {
  const double t = turns - std::floor(turns);
  return t < 0.5 ? 16.0 * t * (0.5 - t) : -16.0 * (t - 0.5) * (1.0 - t);
}

// a point given by its depth along the site's inward direction and two lateral coordinates
Vec3 pointAt(const Site& site, double depth_m, double aside_1_m, double aside_2_m) {
  return site.p_surface_m + site.inward * depth_m + site.across_1 * aside_1_m + site.across_2 * aside_2_m;
}

}  // namespace

Quat pointing(Vec3 axis) {
  // the half-way quaternion (z × axis, 1 + z·axis), normalised
  const double w = 1.0 + axis.z;
  if (w < 1e-12) return {1, 0, 0, 0};
  return normalized(Quat{-axis.y, axis.x, 0, w});
}

Vec3 tilted(Vec3 axis, double tangent, Vec3 toward) {
  return normalized(axis + toward * tangent);
}

MotionBuilder::MotionBuilder(double rate_hz, Vec3 p_start_m, Vec3 axis)
    : rate_hz_(rate_hz), p_(p_start_m), axis_(axis) {
  samples_.push_back({p_start_m, pointing(axis)});
}

std::size_t MotionBuilder::ticks(double seconds) const {
  return static_cast<std::size_t>(std::max(1.0, std::floor(seconds * rate_hz_ + 0.5)));
}

MotionBuilder& MotionBuilder::moveTo(Vec3 p_m, Vec3 axis, double seconds) {
  const std::size_t count = ticks(seconds);
  const Vec3 p_from = p_, axis_from = axis_;
  for (std::size_t i = 1; i <= count; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(count);
    const double s = t * t * t * (10.0 + t * (6.0 * t - 15.0));  // minimum jerk (Flash and Hogan 1985)
    const Vec3 blend = axis_from + (axis - axis_from) * s;
    const Vec3 towards = normSquared(blend) > 1e-12 ? normalized(blend) : axis;
    samples_.push_back({p_from + (p_m - p_from) * s, pointing(towards)});
  }
  p_ = p_m;
  axis_ = axis;
  return *this;
}

MotionBuilder& MotionBuilder::slideTo(Vec3 p_m, double speed_mps) {
  const std::size_t count = ticks(norm(p_m - p_) / speed_mps);
  const Vec3 p_from = p_;
  for (std::size_t i = 1; i <= count; ++i)
    samples_.push_back(
        {p_from + (p_m - p_from) * (static_cast<double>(i) / static_cast<double>(count)), pointing(axis_)});
  p_ = p_m;
  return *this;
}

MotionBuilder& MotionBuilder::hold(double seconds) {
  samples_.insert(samples_.end(), ticks(seconds), TipSample{p_, pointing(axis_)});
  return *this;
}

Motion insertHoldWithdraw(double rate_hz, const Site& site, Vec3 direction, Vec3 axis, double length_m,
                          double speed_mps, double hold_s, double outside_m) {
  const Vec3 p_start = site.p_surface_m - direction * outside_m;
  MotionBuilder builder(rate_hz, p_start, axis);
  builder.slideTo(site.p_surface_m + direction * length_m, speed_mps)
      .hold(hold_s)
      .slideTo(p_start, speed_mps);
  return builder.take();
}

Motion withTremor(Motion motion, double rate_hz, double amplitude_m, std::uint64_t seed) {
  Random random(seed);
  std::array<std::array<double, 4>, 3> waves;  // per axis: two frequencies, two phases
  for (auto& w : waves) w = {random.in(8, 12), random.in(8, 12), random.unit(), random.unit()};
  for (std::size_t k = 0; k < motion.size(); ++k) {
    const double t = static_cast<double>(k) / rate_hz;
    const auto at = [&](std::size_t axis) {
      const auto& w = waves[axis];
      return 0.5 * amplitude_m * (wave(w[0] * t + w[2]) + wave(w[1] * t + w[3]));
    };
    motion[k].p_WT_m += Vec3{at(0), at(1), at(2)};
  }
  return motion;
}

Motion quantised(Motion motion, double step_m) {
  const auto rounded = [&](double value) { return std::floor(value / step_m + 0.5) * step_m; };
  for (auto& sample : motion)
    sample.p_WT_m = {rounded(sample.p_WT_m.x), rounded(sample.p_WT_m.y), rounded(sample.p_WT_m.z)};
  return motion;
}

Motion joined(Motion first, const Motion& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

Motion randomGesture(std::uint64_t seed, double rate_hz, const Site& site, const GestureRange& range) {
  Random random(seed);
  const auto randomAxis = [&] {
    const double a = random.in(-1, 1), b = random.in(-1, 1), tangent = range.tilt_tangent * random.unit();
    const Vec3 aside = site.across_1 * a + site.across_2 * b;
    return normSquared(aside) > 1e-6 ? tilted(site.inward, tangent, normalized(aside)) : site.inward;
  };
  const auto randomPoint = [&](double depth_m) {
    const double a = random.in(-range.aside_m, range.aside_m), b = random.in(-range.aside_m, range.aside_m);
    return pointAt(site, depth_m, a, b);
  };
  // one draw per statement: the evaluation order of arguments is the compiler's choice
  const Vec3 p_start = randomPoint(-range.above_m);
  const Vec3 axis_start = randomAxis();
  MotionBuilder builder(rate_hz, p_start, axis_start);
  for (int i = 0; i < range.legs; ++i) {
    const Vec3 p = randomPoint(random.in(-range.above_m, range.below_m));
    const Vec3 axis = randomAxis();
    builder.moveTo(p, axis, random.in(range.least_leg_s, range.most_leg_s));
    if (random.chance(range.hold_chance)) builder.hold(random.in(0.02, range.most_hold_s));
  }
  const Vec3 p_end = randomPoint(-range.above_m);
  const Vec3 axis_end = randomAxis();
  builder.moveTo(p_end, axis_end, random.in(range.least_leg_s, range.most_leg_s)).hold(0.01);
  Motion motion = builder.take();
  return range.tremor_m > 0 ? withTremor(std::move(motion), rate_hz, range.tremor_m, seed ^ 0x5EEDull)
                            : motion;
}

Motion grazing(double rate_hz, const Site& site, double slope, double length_m, double speed_mps) {
  const double run = length_m / std::sqrt(1 + slope * slope), rise = run * slope;
  const Vec3 along = normalized(site.across_1 + site.inward * slope);
  MotionBuilder builder(rate_hz, pointAt(site, -0.2 * rise, -0.5 * run, 0), along);
  builder.slideTo(pointAt(site, 0.8 * rise, 0.5 * run, 0), speed_mps)
      .hold(0.1)
      .slideTo(pointAt(site, -0.2 * rise, -0.5 * run, 0), speed_mps);
  return builder.take();
}

Motion multipleEntries(std::uint64_t seed, double rate_hz, const Site& site, int count) {
  Random random(seed);
  MotionBuilder builder(rate_hz, pointAt(site, -0.006, 0, 0), site.inward);
  for (int i = 0; i < count; ++i) {
    const double a = random.in(-0.01, 0.01), b = random.in(-0.01, 0.01), depth = random.in(0.002, 0.025);
    const double tangent = random.in(0, 0.5);
    const Vec3 axis = tilted(site.inward, tangent, site.across_2);
    builder.moveTo(pointAt(site, -0.005, a, b), axis, 0.15);
    builder.moveTo(pointAt(site, -0.005, a, b) + axis * (0.005 + depth), axis, random.in(0.1, 0.6));
    if (random.chance(0.5)) builder.hold(random.in(0.05, 0.4));
    builder.moveTo(pointAt(site, -0.005, a, b), axis, random.in(0.1, 0.4));
  }
  return builder.take();
}

}  // namespace needlelab::test
