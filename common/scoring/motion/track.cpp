#include "common/scoring/motion/track.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>
#include <vector>

#include "common/scoring/motion/smoothing.h"

namespace needlelab {
namespace {

/// The averaged channels: tip, axis (both also smoothed), insertion, whether the tip is inside (1 or 0),
/// force.
constexpr std::size_t kChannels = 11;
using Channels = std::array<double, kChannels>;
constexpr std::size_t kInside = 7, kForce = 8;
/// Where the tick of an entry or exit falls on the end of a step, rounding may leave the step a tiny share in
/// tissue: it is outside.
constexpr double kRounding = 1e-9;

Channels channelsOf(const GestureSample& s) {
  const Vec3 axis = zAxis(normalized(Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]}));
  return {s.p_WT_m[0],    s.p_WT_m[1],    s.p_WT_m[2],   axis.x,
          axis.y,         axis.z,         s.insertion_m, isInside(s) ? 1.0 : 0.0,
          s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]};
}

/// Half of a Gaussian's weights, the middle first; together with the other half they sum to 1.
std::vector<double> gaussianHalf(double period_s) {
  const double sigma = kernelSigma(period_s);
  const std::size_t reach = kernelReach(period_s);
  std::vector<double> half(reach + 1);
  double sum = 0;
  for (std::size_t i = 0; i <= reach; ++i) {
    const double x = static_cast<double>(i) / sigma;
    half[i] = std::exp(-0.5 * x * x);
    sum += (i == 0 ? 1 : 2) * half[i];
  }
  for (double& weight : half) weight /= sum;
  return half;
}

void setVelocities(Run& run) {
  const std::size_t n = run.points.size();
  for (std::size_t i = 0; i < n && n > 1; ++i) {
    const std::size_t a = i == 0 ? 0 : i - 1, b = i + 1 == n ? i : i + 1;
    run.points[i].v_WT_mps =
        (run.points[b].p_WT_m - run.points[a].p_WT_m) / (static_cast<double>(b - a) * run.period_s);
  }
}

TrackPoint pointOf(const Channels& c) {
  const Vec3 axis{c[3], c[4], c[5]};
  const double length = norm(axis);
  return {{c[0], c[1], c[2]}, length > 1e-9 ? axis / length : Vec3{0, 0, 1}, {}, c[6]};
}

constexpr double kMinPeak_mps = 1e-6;

double peakOf(std::span<const double> speed_mps) {
  double peak = 0;
  for (const double v : speed_mps) peak = std::max(peak, std::abs(v));
  return peak;
}

/// In-place discrete Fourier transform, length a power of two: bit-reversed order, then butterflies.
void transform(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; (j & bit) != 0; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  std::vector<std::complex<double>> roots(n / 2);
  for (std::size_t k = 0; k < n / 2; ++k) {
    roots[k] = std::polar(1.0, -2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n));
  }
  for (std::size_t half = 1; half < n; half *= 2) {
    for (std::size_t start = 0; start < n; start += 2 * half) {
      for (std::size_t k = 0; k < half; ++k) {
        const std::complex<double> turned = roots[k * (n / (2 * half))] * x[start + half + k];
        x[start + half + k] = x[start + k] - turned;
        x[start + k] += turned;
      }
    }
  }
}

}  // namespace

/// Fills a run of more than one tick from its samples.
class RunsInSteps::Filling {
 public:
  Filling(Run& run, const RecordedSamples& samples, double rate_hz, double duration_s)
      : run_(run),
        samples_(samples),
        rate_hz_(rate_hz),
        end_s_(duration_s),
        intervals_(motionSteps(duration_s)),
        bin_s_(duration_s / static_cast<double>(2 * intervals_)),
        first_(samples[run.first]),
        value_(channelsOf(first_)),
        next_(run.first + 1),
        points_(intervals_ + 1) {
    run.period_s = duration_s / static_cast<double>(intervals_);
    run.inside.reserve(intervals_);
    run.force_W_N.reserve(intervals_);
    run.points.reserve(intervals_ + 1);
    points_.front() = value_;
    points_.back() = channelsOf(samples[run.last]);
  }

  /// Returns true when the run is filled.
  bool step(StepWork& work) {
    for (; next_ <= run_.last; ++next_) {
      if (work.isOver()) return false;
      work.spend(1);
      add(samples_[next_]);
    }
    while (bin_ < 2 * intervals_) endBin();
    finish(work);
    return true;
  }

 private:
  /// Adds the segment to the next sample: bins of half a period hold the means of the piecewise linear signal
  /// through the samples.
  void add(const GestureSample& sample) {
    const double next_s = secondsBetween(first_, sample, rate_hz_);
    const Channels next = channelsOf(sample);
    // this segment's part in each bin that it touches: trapezoid, exact for a straight line
    double from_s = time_s_;
    while (from_s < next_s) {
      const bool is_last = bin_ + 1 == 2 * intervals_;
      const double bin_end_s = is_last ? end_s_ : static_cast<double>(bin_ + 1) * bin_s_;
      const double to_s = std::min(next_s, bin_end_s);
      const double middle = (0.5 * (from_s + to_s) - time_s_) / (next_s - time_s_);
      const double share = (to_s - from_s) / bin_s_;
      for (std::size_t c = 0; c < kChannels; ++c)
        mean_[c] += share * (value_[c] + middle * (next[c] - value_[c]));
      if (to_s >= bin_end_s && !is_last) endBin();
      if (to_s <= from_s) break;  // rounding residue
      from_s = to_s;
    }
    time_s_ = next_s;
    value_ = next;
  }

  /// A point's value is the mean of its two bins; an end point keeps the end's value.
  void endBin() {
    if (bin_ % 2 == 1) {
      const double inside = std::clamp(0.5 * (before_[kInside] + mean_[kInside]), 0.0, 1.0);
      run_.inside.push_back(inside > kRounding ? inside : 0.0);
      const auto force = [&](std::size_t c) { return 0.5 * (before_[kForce + c] + mean_[kForce + c]); };
      run_.force_W_N.push_back({force(0), force(1), force(2)});
    } else if (bin_ > 0) {
      for (std::size_t c = 0; c < kChannels; ++c) points_[bin_ / 2][c] = 0.5 * (before_[c] + mean_[c]);
    }
    before_ = std::exchange(mean_, Channels{});
    ++bin_;
  }

  void finish(StepWork& work) {
    // an exit resets the insertion, so average it but do not smooth it
    const std::vector<double> kernel = gaussianHalf(run_.period_s);
    work.spend(points_.size() * kernel.size() / 16);
    std::vector<double> channel(points_.size());
    for (std::size_t c = 0; c < 6; ++c) {
      for (std::size_t i = 0; i < points_.size(); ++i) channel[i] = points_[i][c];
      channel = smoothed(channel, kernel);
      for (std::size_t i = 0; i < points_.size(); ++i) points_[i][c] = channel[i];
    }
    for (const Channels& c : points_) run_.points.push_back(pointOf(c));
    setVelocities(run_);
  }

  Run& run_;
  const RecordedSamples& samples_;
  const double rate_hz_, end_s_;
  const std::size_t intervals_;
  const double bin_s_;
  const GestureSample first_;
  Channels mean_{}, value_, before_{};  // of the bin so far, at the previous sample, of the previous bin
  double time_s_ = 0;                   // of the previous sample
  std::size_t next_, bin_ = 0;
  std::vector<Channels> points_;
};

RunsInSteps::RunsInSteps(const RecordedSamples& samples, double rate_hz)
    : samples_(samples), rate_hz_(rate_hz) {}

RunsInSteps::~RunsInSteps() = default;

bool RunsInSteps::step(StepWork& work) {
  for (; next_ < samples_.size(); ++next_) {
    if (work.isOver()) return false;
    work.spend(1);
    const bool is_new =
        next_ == 0 || secondsBetween(samples_[next_ - 1], samples_[next_], rate_hz_) > kLongestBridge_s;
    if (is_new) {
      runs_.emplace_back();
      runs_.back().first = next_;
      runs_.back().start_s = secondsBetween(samples_.front(), samples_[next_], rate_hz_);
    }
    runs_.back().last = next_;
  }
  for (; filled_ < runs_.size(); ++filled_) {
    if (work.isOver()) return false;
    Run& run = runs_[filled_];
    if (!filling_) {
      work.spend(1);
      const GestureSample first = samples_[run.first];
      const double duration_s = secondsBetween(first, samples_[run.last], rate_hz_);
      if (!(duration_s > 0)) {  // a single sample; or after a fault, samples without ticks
        run.points.push_back(pointOf(channelsOf(first)));
        continue;
      }
      filling_ = std::make_unique<Filling>(run, samples_, rate_hz_, duration_s);
    }
    if (!filling_->step(work)) return false;
    filling_.reset();
  }
  return true;
}

std::vector<Run> runsOf(const RecordedSamples& samples, double rate_hz) {
  RunsInSteps runs(samples, rate_hz);
  StepWork all = StepWork::all();
  runs.step(all);
  return runs.take();
}

std::vector<Run> runsOf(std::span<const GestureSample> samples, double rate_hz) {
  return runsOf(RecordedSamples(samples), rate_hz);
}

std::vector<Vec3> pathInTissue(std::span<const Run> runs, const Pose& X_WL, double path_rate_hz,
                               std::size_t most) {
  // first entry and last exit, in s since the first sample
  double from_s = -1, to_s = -1;
  for (const Run& run : runs) {
    for (std::size_t i = 0; i < run.inside.size(); ++i) {
      if (!(run.inside[i] > 0)) continue;
      const double at_s = run.start_s + static_cast<double>(i) * run.period_s;
      if (from_s < 0) from_s = at_s;
      to_s = at_s + run.period_s;
    }
  }
  std::vector<Vec3> path;
  if (from_s < 0) return path;
  const Pose X_LW = inverse(Pose{X_WL.p, normalized(X_WL.q)});
  for (const Run& run : runs) {
    if (run.inside.empty()) continue;
    const double begin_s = std::max(from_s, run.start_s);
    const double end_s = std::min(to_s, run.start_s + static_cast<double>(run.inside.size()) * run.period_s);
    for (std::size_t k = 0; path.size() <= most; ++k) {
      const double at_s = begin_s + static_cast<double>(k) / path_rate_hz;
      if (at_s > end_s + 1e-9) break;
      const double place = std::max(0.0, (at_s - run.start_s) / run.period_s);
      const std::size_t i = std::min(static_cast<std::size_t>(place), run.inside.size() - 1);
      const double share = std::min(1.0, place - static_cast<double>(i));
      const Vec3 a = run.points[i].p_WT_m, b = run.points[i + 1].p_WT_m;
      path.push_back(X_LW * (a + share * (b - a)));
    }
  }
  return path;
}

std::optional<double> sparc(std::span<const double> speed_mps, double rate_hz) {
  if (speed_mps.size() < 3 || speed_mps.size() > kLongestProfile) return std::nullopt;
  if (peakOf(speed_mps) < kMinPeak_mps) return std::nullopt;

  // amplitude spectrum up to the cut-off, normalised to its maximum there
  std::vector<std::complex<double>> spectrum(std::bit_ceil(speed_mps.size()) << kSparcPadding);
  std::copy(speed_mps.begin(), speed_mps.end(), spectrum.begin());
  transform(spectrum);
  const double step_hz = rate_hz / static_cast<double>(spectrum.size());
  std::vector<double> amplitude;
  for (std::size_t k = 0; k < spectrum.size() && static_cast<double>(k) * step_hz <= kSparcCutoffHz; ++k) {
    amplitude.push_back(std::abs(spectrum[k]));
  }
  const double greatest = *std::max_element(amplitude.begin(), amplitude.end());
  if (!(greatest > 0)) return std::nullopt;

  // the part between the first and the last frequency at or above the threshold
  const auto reaches = [&](double a) { return a >= kSparcThreshold * greatest; };
  const auto first = std::find_if(amplitude.begin(), amplitude.end(), reaches);
  const auto last = std::find_if(amplitude.rbegin(), amplitude.rend(), reaches).base() - 1;
  if (first >= last) return std::nullopt;
  const double width = 1.0 / static_cast<double>(last - first);
  double length = 0;
  for (auto a = first; a != last; ++a) length += std::hypot(width, (a[1] - a[0]) / greatest);
  return -length;
}

std::optional<double> ldlj(std::span<const double> speed_mps, double rate_hz) {
  if (speed_mps.size() < 3) return std::nullopt;
  const double peak = peakOf(speed_mps);
  if (peak < kMinPeak_mps) return std::nullopt;
  double sum = 0;
  for (std::size_t i = 2; i < speed_mps.size(); ++i) {
    const double second = (speed_mps[i] - 2 * speed_mps[i - 1] + speed_mps[i - 2]) * rate_hz * rate_hz;
    sum += second * second;
  }
  const double duration_s = static_cast<double>(speed_mps.size()) / rate_hz;
  const double jerk = duration_s * duration_s * duration_s / (peak * peak) * sum / rate_hz;
  if (!(jerk > 0)) return std::nullopt;
  return -std::log(jerk);
}

}  // namespace needlelab
