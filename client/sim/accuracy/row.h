/// One row of the accuracy report: one choice with its cost in time and its accuracy.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/accuracy/tick_cost.h"

namespace needlelab {

/// The choice that a study varies.
enum class AccuracyStudy : std::uint8_t {
  kModel,    ///< the axial model
  kMesh,     ///< size of the FEM mesh
  kRate,     ///< rate of the haptic loop
  kStorage,  ///< stored resolution
  kLive,     ///< interval of the live frames
};
inline constexpr std::array<std::string_view, 5> kAccuracyStudyNames = {"model", "mesh", "rate", "storage",
                                                                        "live"};
constexpr std::string_view nameOf(AccuracyStudy study) {
  return kAccuracyStudyNames[static_cast<std::size_t>(study)];
}

/// A value that a study does not use or could not measure is absent, null in JSON. Rows may be compared with
/// each other (on one Pareto front) when study, scene and reference agree.
struct AccuracyRow {
  AccuracyStudy study = AccuracyStudy::kModel;
  std::string scene;                  ///< e.g. "paper-six-layers", "bovine_liver_heart_18g"
  std::string model;                  ///< a name of kAxialModelNames; empty = absent
  std::optional<double> rate_hz;      ///< of the haptic loop
  std::optional<double> mesh_nodes;   ///< of the FEM
  std::optional<double> quantum_m;    ///< step of stored lengths; 0 = lossless
  std::optional<double> frame_s;      ///< interval of live frames
  std::string reference;              ///< the comparator of the error, as text; never empty
  std::optional<double> rms_error_n;  ///< of force
  std::optional<double> max_error_n;  ///< of force
  std::optional<double> bytes_per_sample;
  std::optional<double> latency_ms;  ///< mean, from a sample's tick to the viewer
  std::optional<double> cpu_share;   ///< of one core: processor time per time of the lesson
  /// Of one tick (model, mesh, rate: hot; model and rate less an empty call) or one sample (storage, live).
  std::optional<double> median_ns;
  std::optional<double> p99_ns;
  std::optional<double> precompute_s;  ///< once, before the lesson: the price of a mesh (mesh)
  std::optional<bool> fits_rate;  ///< the tail, alone on a core, is within the period of its rate: p99.9 of
                                  ///< single ticks where `cost` is there, else p99_ns, else median_ns

  // for some studies only
  std::string variant;               ///< a choice that has no column, e.g. "PRECOMPUTED table, 2,000 nodes"
  std::optional<double> parameters;  ///< numbers that were fitted to data of the comparator
  /// Standard deviation of rms_error_n over seeds or repeats; of a mesh, what the comparator, the finest
  /// mesh, itself misses by Richardson's estimate.
  std::optional<double> rms_error_spread_n;
  /// Greatest change of force from one tick to the next, but for the falls that the report declares as
  /// releases.
  std::optional<double> max_step_n;
  std::optional<double> noticeable_n;            ///< just noticeable difference at this scene's forces
  std::optional<TickCost> cost;                  ///< of single ticks (model, rate)
  std::optional<CostInterval> runs_ns;           ///< of a sample (storage, live): five runs
  std::optional<double> instructions;            ///< of a tick, mean over the study's gesture
  std::optional<double> felt_stiffness_N_per_m;  ///< along the trajectory, drawn back 0.2 mm in the tissue
  std::optional<double> stiffness_margin;  ///< stiffness that the device alone can render at this rate, to
                                           ///< the scene's: b/(T (1/2 + delay))/K
  std::optional<double> rms_error_m;       ///< of position
  std::optional<double> latency_p99_ms;
  std::optional<double> bytes_per_s;  ///< on the wire, framing and TLS included
  bool advises = true;  ///< false: shown, but no choice follows from its whole group (an extrapolation)
  /// The comparator contains this row's own law (a finer copy of itself, the profile that its wall renders):
  /// it is shown and says so in `cannot_show`, but cannot be chosen.
  bool own_law = false;
  std::string uncertainty;  ///< a text with numbers; never empty
  std::string cannot_show;  ///< limits of this row's evidence; never empty
};

using AccuracyRows = std::vector<AccuracyRow>;

/// Fills the cost of a tick at `rate_hz` of them a second: `cost`, hot median (less an empty call) and p99,
/// share of a core by the price, and whether the tail fits.
void setCost(AccuracyRow& row, const TickCost& cost, double rate_hz);

/// The row as JSON: its columns in their order; null where absent.
nlohmann::ordered_json jsonOf(const AccuracyRow& row);

/// Just noticeable difference at a force: 7 % from 2.5 N on (the literature: between 2.5 and 10 N); below 2.5
/// N people distinguish relatively less, so the difference is constant at 0.175 N. In N.
double noticeableForce_N(double force_N);

/// Root mean square and greatest of errors that are added one after the other.
class ErrorSum {
 public:
  void add(double error) {
    square_ += error * error;
    max_ = std::max(max_, std::abs(error));
    ++count_;
  }
  [[nodiscard]] double rms() const {
    return count_ > 0 ? std::sqrt(square_ / static_cast<double>(count_)) : 0;
  }
  [[nodiscard]] double max() const { return max_; }
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  double square_ = 0, max_ = 0;
  std::size_t count_ = 0;
};

/// Several runs of the same kind, e.g. one a seed, each with the same weight.
class ErrorRuns {
 public:
  void add(const ErrorSum& run) {
    rms_.push_back(run.rms());
    max_ = std::max(max_, run.max());
  }
  /// Over all runs: root of the mean of their squares.
  [[nodiscard]] double rms() const {
    ErrorSum all;
    for (const double one : rms_) all.add(one);
    return all.rms();
  }
  [[nodiscard]] double max() const { return max_; }
  /// Standard deviation of the runs' rms (n − 1); 0 for one run.
  [[nodiscard]] double spread() const {
    if (rms_.size() < 2) return 0;
    double mean = 0, square = 0;
    for (const double one : rms_) mean += one / static_cast<double>(rms_.size());
    for (const double one : rms_) square += (one - mean) * (one - mean);
    return std::sqrt(square / static_cast<double>(rms_.size() - 1));
  }
  [[nodiscard]] std::size_t runs() const { return rms_.size(); }

 private:
  std::vector<double> rms_;
  double max_ = 0;
};

/// "rms ± 0.012 N (sd over 8 seeds)".
std::string spreadText(const ErrorRuns& runs, const char* of);

}  // namespace needlelab
