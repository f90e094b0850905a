#include "client/device/pivot.h"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "common/base/histogram.h"

namespace needlelab {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSingular = 1e-9;  // of M: the turns leave a direction undetermined
constexpr std::size_t kFewest = 10;
constexpr int kSubsets = 300;
constexpr std::size_t kSubsetSize = 4;  // three poses with different axes suffice
constexpr std::size_t kJudged = 500;    // samples that rate a subset
constexpr double kStrayFloor_m = 0.2e-3;
constexpr double kStraySigmas = 5;  // chi of three coordinates: 1.5e-5 lie beyond
constexpr double kMedianOfChi3 = 1.5382;
constexpr double kJoin_s = 0.1, kShortestSlip_s = 0.05;

Vector3d eigen(Vec3 v) {
  return {v.x, v.y, v.z};
}
Vec3 plain(const Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}
std::array<double, 9> rows(const Matrix3d& m) {
  std::array<double, 9> out{};
  for (int i = 0; i < 9; ++i) out[static_cast<std::size_t>(i)] = m(i / 3, i % 3);
  return out;
}

Matrix3d meanOf(const std::array<double, 9>& sum, std::size_t count) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(sum.data()) /
         static_cast<double>(count);
}

double residual(const PivotSample& sample, Vec3 p_HT_m, Vec3 p_WP_m) {
  return norm(sample.X_WH * p_HT_m - p_WP_m);
}

// SplitMix64: the same subsets on every machine
class Dice {
 public:
  std::size_t below(std::size_t n) {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return static_cast<std::size_t>((z ^ (z >> 31)) % n);
  }

 private:
  std::uint64_t state_ = 1;
};

struct Start {
  Vec3 p_HT_m, p_WP_m;
  double median_m = 0;
};

// median residual of a candidate, over samples at even intervals
Start judged(const PivotSums::Solution& s, std::span<const PivotSample> samples,
             std::vector<double>& scratch) {
  scratch.clear();
  const std::size_t stride = std::max<std::size_t>(1, samples.size() / kJudged);
  for (std::size_t i = 0; i < samples.size(); i += stride)
    scratch.push_back(residual(samples[i], s.p_HT_m, s.p_WP_m));
  return {s.p_HT_m, s.p_WP_m, medianOf(scratch)};
}

std::optional<Start> bestStart(std::span<const PivotSample> samples) {
  std::optional<Start> best;
  std::vector<double> scratch;
  const auto consider = [&](const PivotSums& sums) {
    const auto solution = sums.solve();
    if (!solution.ok()) return;
    const Start start = judged(*solution, samples, scratch);
    if (!best || start.median_m < best->median_m) best = start;
  };
  PivotSums all;
  for (const PivotSample& sample : samples) all.add(sample.X_WH);
  consider(all);
  Dice dice;
  for (int i = 0; i < kSubsets; ++i) {
    PivotSums few;
    for (std::size_t k = 0; k < kSubsetSize; ++k) few.add(samples[dice.below(samples.size())].X_WH);
    consider(few);
  }
  return best;
}

// number of neighbouring samples worth one: 1 + 2·Σρ_k, up to the first small ρ
double correlationOf(const std::vector<Vec3>& residuals) {
  double power = 0;
  for (const Vec3& r : residuals) power += normSquared(r);
  if (!(power > 0)) return 1;
  double sum = 1;
  const std::size_t longest = std::min<std::size_t>(residuals.size() / 4, 4000);
  for (std::size_t lag = 1; lag < longest; ++lag) {
    double shifted = 0;
    for (std::size_t i = lag; i < residuals.size(); ++i) shifted += dot(residuals[i], residuals[i - lag]);
    const double rho = shifted / power;
    if (rho < 0.02) break;
    sum += 2 * rho;
  }
  return sum;
}

// intervals of the dropped samples, joined across small gaps; short ones are single outliers
std::vector<PivotSlip> slipsOf(std::span<const PivotSample> samples, const std::vector<bool>& used,
                               const PivotFit& fit) {
  std::vector<PivotSlip> slips;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (used[i]) continue;
    const double t_s = samples[i].t_s;
    if (slips.empty() || t_s - slips.back().to_s > kJoin_s) slips.push_back({t_s, t_s, 0, 0});
    PivotSlip& slip = slips.back();
    slip.to_s = t_s;
    slip.distance_m += residual(samples[i], fit.p_HT_m, fit.p_WP_m);
    ++slip.samples;
  }
  for (PivotSlip& slip : slips) slip.distance_m /= static_cast<double>(slip.samples);
  std::erase_if(slips,
                [](const PivotSlip& s) { return s.to_s - s.from_s < kShortestSlip_s || s.samples < 3; });
  return slips;
}

Status checked(std::span<const PivotSample> samples) {
  for (const PivotSample& sample : samples)
    if (!isFinite(sample.X_WH.p) || !isFinite(sample.X_WH.q) ||
        !(std::abs(std::sqrt(dot(sample.X_WH.q, sample.X_WH.q)) - 1) <= 1e-3))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("the pose at {:.3f} s is not finite or no rotation", sample.t_s)};
  if (samples.size() < kFewest)
    return Error{ErrorCode::kFailed,
                 fmt::format("only {} poses; at least {} are needed", samples.size(), kFewest)};
  return {};
}

}  // namespace

void PivotSums::add(const Pose& X_WH) {
  if (count_++ == 0) origin_W_m_ = X_WH.p;
  const Vec3 p = X_WH.p - origin_W_m_;
  const Vec3 columns[3] = {rotate(X_WH.q, {1, 0, 0}), rotate(X_WH.q, {0, 1, 0}), rotate(X_WH.q, {0, 0, 1})};
  sum_p_ += p;
  sum_pp_ += normSquared(p);
  sum_RTp_ += {dot(columns[0], p), dot(columns[1], p), dot(columns[2], p)};
  for (std::size_t c = 0; c < 3; ++c) {
    sum_R_[c] += columns[c].x;
    sum_R_[3 + c] += columns[c].y;
    sum_R_[6 + c] += columns[c].z;
  }
}

double PivotSums::spread() const {
  if (count_ == 0) return 0;
  const Matrix3d mean_R = meanOf(sum_R_, count_);
  const Matrix3d M = Matrix3d::Identity() - mean_R.transpose() * mean_R;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigenvalues(M, Eigen::EigenvaluesOnly);
  return std::clamp(eigenvalues.eigenvalues()(0), 0.0, 1.0);
}

Result<PivotSums::Solution> PivotSums::solve() const {
  const Error open{
      ErrorCode::kFailed,
      "the handle did not turn enough to say where the tip is: swing it about the dimple, to all sides"};
  if (count_ < 3) return open;
  const auto n = static_cast<double>(count_);
  const Matrix3d mean_R = meanOf(sum_R_, count_);
  const Vector3d mean_p = eigen(sum_p_ / n), mean_RTp = eigen(sum_RTp_ / n);
  const Matrix3d M = Matrix3d::Identity() - mean_R.transpose() * mean_R;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> system(M);
  const Vector3d& values = system.eigenvalues();
  if (!(values(0) > kSingular)) return open;

  const Matrix3d inverse =
      system.eigenvectors() * values.cwiseInverse().asDiagonal() * system.eigenvectors().transpose();
  const Vector3d tip = inverse * (mean_R.transpose() * mean_p - mean_RTp);
  const Vector3d pivot = mean_p + mean_R * tip;
  Solution solution;
  solution.p_HT_m = plain(tip);
  solution.p_WP_m = origin_W_m_ + plain(pivot);
  const double mean_square = sum_pp_ / n + tip.squaredNorm() + 2 * tip.dot(mean_RTp) - pivot.squaredNorm();
  solution.residual_rms_m = std::sqrt(std::max(0.0, mean_square));
  solution.inverse_M = rows(inverse);
  solution.spread = std::min(values(0), 1.0);
  solution.weakest_H = plain(system.eigenvectors().col(0));
  return solution;
}

Result<PivotFit> fitPivot(std::span<const PivotSample> samples) {
  RETURN_IF_ERROR(checked(samples));
  const auto start = bestStart(samples);
  if (!start) return PivotSums().solve().error();

  // drop outliers until nothing changes
  PivotFit fit;
  fit.p_HT_m = start->p_HT_m;
  fit.p_WP_m = start->p_WP_m;
  fit.samples = samples.size();
  double scale_m = start->median_m / kMedianOfChi3;
  std::vector<bool> used(samples.size(), false), before;
  std::vector<double> inside;
  PivotSums::Solution solution;
  for (int round = 0; round < 20 && used != before; ++round) {
    before = used;
    const double limit_m = std::max(kStrayFloor_m, kStraySigmas * scale_m);
    PivotSums sums;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      used[i] = residual(samples[i], fit.p_HT_m, fit.p_WP_m) <= limit_m;
      if (used[i]) sums.add(samples[i].X_WH);
    }
    ASSIGN_OR_RETURN(solution, sums.solve());
    fit.p_HT_m = solution.p_HT_m;
    fit.p_WP_m = solution.p_WP_m;
    fit.used = sums.samples();
    inside.clear();
    for (std::size_t i = 0; i < samples.size(); ++i)
      if (used[i]) inside.push_back(residual(samples[i], fit.p_HT_m, fit.p_WP_m));
    scale_m = medianOf(inside) / kMedianOfChi3;
  }

  // quality of the fit
  std::vector<Vec3> residuals;
  double square_sum = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!used[i]) continue;
    residuals.push_back(samples[i].X_WH * fit.p_HT_m - fit.p_WP_m);
    square_sum += normSquared(residuals.back());
    fit.residual_max_m = std::max(fit.residual_max_m, norm(residuals.back()));
  }
  const auto n = static_cast<double>(fit.used);
  fit.residual_rms_m = std::sqrt(square_sum / n);
  fit.spread = solution.spread;
  fit.weakest_H = solution.weakest_H;
  fit.correlation_samples = correlationOf(residuals);
  const double variance_m2 = square_sum / std::max(1.0, 3 * n - 6);
  const double scale = variance_m2 * fit.correlation_samples / n;
  for (std::size_t i = 0; i < 9; ++i) fit.covariance_m2[i] = scale * solution.inverse_M[i];
  fit.worst_sigma_m = std::sqrt(scale / fit.spread);
  fit.slips = slipsOf(samples, used, fit);
  return fit;
}

double expectedError_m(const PivotFit& fit) {
  return 2 * std::hypot(fit.residual_rms_m, fit.worst_sigma_m);
}

std::string pivotTrouble(const PivotFit& fit) {
  if (fit.spread < kMinSpread)
    return fmt::format(
        "the swing was too small: {:.0f} % of the spread that is needed. Swing the handle by at least 20° to "
        "every side, forward, backward, left and right, and turn it about itself; the tip stays in the "
        "dimple",
        100 * fit.spread / kMinSpread);
  const double left_out = 1 - static_cast<double>(fit.used) / static_cast<double>(fit.samples);
  if (left_out > kMaxSlipped) {
    std::string text = fmt::format("the tip was out of the dimple in {:.0f} % of the time", 100 * left_out);
    if (!fit.slips.empty())
      text += fmt::format(", first from {:.1f} to {:.1f} s, by {:.1f} mm", fit.slips.front().from_s,
                          fit.slips.front().to_s, 1e3 * fit.slips.front().distance_m);
    return text + ". Take a deeper dimple, press less, swing more slowly, and repeat";
  }
  if (fit.residual_rms_m > kMaxResidual_m)
    return fmt::format(
        "the poses do not fit one tip: {:.2f} mm RMS are left, {:.1f} mm are allowed. Was the tip in the "
        "dimple, "
        "is the needle firm in its holder, does the plate with the dimple stand still?",
        1e3 * fit.residual_rms_m, 1e3 * kMaxResidual_m);
  if (2 * fit.worst_sigma_m > kMaxError_m)
    return fmt::format(
        "the tip is known to ±{:.2f} mm only (2σ), ±{:.1f} mm are allowed. Swing longer and further to all "
        "sides",
        2e3 * fit.worst_sigma_m, 1e3 * kMaxError_m);
  return {};
}

}  // namespace needlelab
