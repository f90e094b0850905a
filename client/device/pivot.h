/// Where the needle's tip is in the handle's frame, from poses of the handle while the tip rests in a dimple
/// and the handle swings about it ("pivot calibration").
///
/// Every pose i gives p_WH,i + R_i·p_HT = p_WP, three linear equations for six unknowns: tip p_HT and pivot
/// p_WP. Of the least squares solution p_WP is eliminated: with means over the samples (bar),
///   M·p_HT = R̄ᵀp̄ − mean(R_iᵀp_i),   M = I − R̄ᵀR̄,   p_WP = p̄ + R̄·p_HT,
/// and with noise of σ per coordinate cov(p_HT) = σ²/n·M⁻¹. M's eigenvalues tell how well the orientations
/// are spread: 0 when nothing turned, and for a turn about one axis only, along that axis.
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
  double t_s = 0;  ///< since the beginning; ascending
  Pose X_WH;       ///< unit quaternion
};

/// A time in which the tip was somewhere else than in the dimple.
struct PivotSlip {
  double from_s = 0, to_s = 0;
  double distance_m = 0;  ///< between tip and dimple, mean
  std::size_t samples = 0;
};

/// The running fit, in constant memory: for progress. Thread: one.
class PivotSums {
 public:
  void add(const Pose& X_WH);
  [[nodiscard]] std::size_t samples() const { return count_; }
  /// Least eigenvalue of M, in [0, 1]: about the mean square (rad²) of the turns about the axis that the
  /// handle turned about least. kLeastSpread is enough.
  [[nodiscard]] double spread() const;

  struct Solution {
    Vec3 p_HT_m, p_WP_m;
    double residual_rms_m = 0;          ///< root of the mean of |p_WH + R·p_HT − p_WP|²
    std::array<double, 9> inverse_M{};  ///< row by row
    double spread = 0;
    Vec3 weakest_H;  ///< unit; the direction in which the tip is known worst
  };
  /// Errors (kFailed): fewer than 3 samples, or turns that leave a direction open.
  [[nodiscard]] Result<Solution> solve() const;

 private:
  std::size_t count_ = 0;
  Vec3 origin_W_m_;  // the first position: sums stay small
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
  double spread = 0;  ///< as PivotSums::spread
  Vec3 weakest_H;
  std::array<double, 9> covariance_m2{};  ///< of p_HT_m, row by row
  double worst_sigma_m = 0;               ///< standard deviation along weakest_H
  double correlation_samples = 1;         ///< how many samples tell as much as one independent one
  std::size_t samples = 0, used = 0;      ///< used: without those of the slips and strays
  std::vector<PivotSlip> slips;
};

inline constexpr double kLeastSpread = 0.02;     ///< 8° RMS about every axis: swings of 20° to all sides
inline constexpr double kMostResidual_m = 2e-3;  ///< RMS; more means that the tip was not held
inline constexpr double kMostError_m = 1e-3;     ///< two standard deviations
inline constexpr double kMostSlipped = 0.2;      ///< share of samples away from the dimple

/// Robust: starts from the best of 300 small subsets (least median of the residuals; Rousseeuw 1984), then
/// leaves out samples further off than 5 robust standard deviations (and 0.2 mm), until nothing changes. Up
/// to half of the samples may be wrong. The covariance counts correlated samples as fewer: n is divided by
/// 1 + 2·Σ autocorrelation of the residuals. Deterministic.
/// Errors: kInvalidInput: a pose that is not finite or no rotation; kFailed: fewer than 10 samples, or turns
/// that leave a direction open.
Result<PivotFit> fitPivot(std::span<const PivotSample> samples);

/// The tip's error to expect in use: two standard deviations of a single pose's tip (its residual) and
/// of the tool together.
double expectedError_m(const PivotFit& fit);

/// Why a fit must not become a tool, with advice; empty when it may.
std::string pivotTrouble(const PivotFit& fit);

}  // namespace needlelab
