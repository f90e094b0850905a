/// Pivot calibration: computes the needle's tip in the handle's frame from poses of the handle while the tip
/// rests in a dimple and the handle swings about it.
///
/// Every pose i gives p_WH,i + R_i·p_HT = p_WP, three linear equations for six unknowns: tip p_HT and pivot
/// p_WP. Eliminating p_WP from the least squares solution gives, with means over the samples (bar),
///   M·p_HT = R̄ᵀp̄ − mean(R_iᵀp_i),   M = I − R̄ᵀR̄,   p_WP = p̄ + R̄·p_HT,
/// and with noise of σ per coordinate cov(p_HT) = σ²/n·M⁻¹. M's eigenvalues show how well the orientations
/// are spread: 0 without turns, and for turns about one axis only, 0 along that axis.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

struct PivotSample {
  double t_s = 0;  ///< since the start; ascending
  Pose X_WH;       ///< unit quaternion
};

/// An interval in which the tip was outside the dimple.
struct PivotSlip {
  double from_s = 0, to_s = 0;
  double distance_m = 0;  ///< between tip and dimple, mean
  std::size_t samples = 0;
};

/// A running fit in constant memory, to show progress. Thread: one.
class PivotSums {
 public:
  void add(const Pose& X_WH);
  [[nodiscard]] std::size_t samples() const { return count_; }
  /// Least eigenvalue of M, in [0, 1]: about the mean square (rad²) of the turns about the axis with the
  /// least turning. kMinSpread is enough.
  [[nodiscard]] double spread() const;

  struct Solution {
    Vec3 p_HT_m, p_WP_m;
    double residual_rms_m = 0;          ///< root of the mean of |p_WH + R·p_HT − p_WP|²
    std::array<double, 9> inverse_M{};  ///< row by row
    double spread = 0;
    Vec3 weakest_H;  ///< unit; the direction of the tip's largest uncertainty
  };
  /// Errors (kFailed): fewer than 3 samples, or turns that leave a direction undetermined.
  [[nodiscard]] Result<Solution> solve() const;

 private:
  std::size_t count_ = 0;
  Vec3 origin_W_m_;  // the first position, so that the sums stay small
  Vec3 sum_p_;
  Vec3 sum_RTp_;
  std::array<double, 9> sum_R_{};  // row by row
  double sum_pp_ = 0;
};

struct PivotFit {
  Vec3 p_HT_m;                ///< the tip in the handle's frame
  Vec3 p_WP_m;                ///< the dimple
  double residual_rms_m = 0;  ///< of the samples used
  double residual_max_m = 0;
  double spread = 0;  ///< see PivotSums::spread
  Vec3 weakest_H;
  std::array<double, 9> covariance_m2{};  ///< of p_HT_m, row by row
  double worst_sigma_m = 0;               ///< standard deviation along weakest_H
  double correlation_samples = 1;         ///< number of samples worth one independent sample
  std::size_t samples = 0, used = 0;      ///< used: without slips and outliers
  std::vector<PivotSlip> slips;
};

inline constexpr double kMinSpread = 0.02;      ///< 8° RMS about every axis: swings of 20° to all sides
inline constexpr double kMaxResidual_m = 2e-3;  ///< RMS; above this the tip was not held in the dimple
inline constexpr double kMaxError_m = 1e-3;     ///< two standard deviations
inline constexpr double kMaxSlipped = 0.2;      ///< share of samples away from the dimple

/// Robust: starts from the best of 300 small subsets (least median of the residuals; Rousseeuw 1984), then
/// drops samples beyond 5 robust standard deviations (and 0.2 mm), until nothing changes. Up to half of the
/// samples may be wrong. The covariance corrects for correlated samples: it divides n by 1 + 2·Σ
/// autocorrelation of the residuals. Deterministic. Errors: kInvalidInput: a pose that is not finite or not a
/// rotation; kFailed: fewer than 10 samples, or turns that leave a direction undetermined.
Result<PivotFit> fitPivot(std::span<const PivotSample> samples);

/// Returns the expected tip error in use: two standard deviations, combining a single pose's tip (its
/// residual) and the tool.
double expectedError_m(const PivotFit& fit);

/// Explains why a fit is unusable as a tool, with advice; empty when it is usable.
std::string pivotTrouble(const PivotFit& fit);

}  // namespace needlelab
