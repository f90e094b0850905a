/// One row of the accuracy report (DESIGN §5): what one choice costs in time, and what it gives.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/clock.h"

namespace needlelab {

/// What is varied.
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

/// What a study does not use or could not measure is absent, null in JSON. Rows may be compared with each
/// other (on one Pareto front) when study, scene and reference agree.
struct AccuracyRow {
  AccuracyStudy study = AccuracyStudy::kModel;
  std::string scene;                  ///< e.g. "paper-six-layers", "bovine_liver_heart_18g"
  std::string model;                  ///< a name of kAxialModelNames; empty = absent
  std::optional<double> rate_hz;      ///< of the haptic loop
  std::optional<double> mesh_nodes;   ///< of the FEM
  std::optional<double> quantum_m;    ///< step of stored lengths; 0 = lossless
  std::optional<double> frame_s;      ///< interval of live frames
  std::string reference;              ///< what the error is taken against, in words; never empty
  std::optional<double> rms_error_n;  ///< of force
  std::optional<double> max_error_n;  ///< of force
  std::optional<double> bytes_per_sample;
  std::optional<double> latency_ms;  ///< mean, from a sample's tick to the viewer
  std::optional<double> cpu_share;   ///< of one core: processor time per time of the lesson
  std::optional<double> median_ns;   ///< of one tick (model, mesh, rate) or one sample (storage, live)
  std::optional<double> p99_ns;
  std::optional<bool> fits_rate;  ///< p99_ns (median_ns where there is no p99), alone on a core, is within
                                  ///< the period of its rate

  // beyond DESIGN §5
  std::string variant;  ///< a choice that has no column, e.g. "PRECOMPUTED table, 2,000 nodes"
  std::optional<double> rms_error_spread_n;  ///< standard deviation of rms_error_n over seeds or repeats
  /// Greatest change of force from one tick to the next, but for the falls that the report declares as
  /// releases.
  std::optional<double> max_step_n;
  std::optional<double> noticeable_n;      ///< just noticeable difference at this scene's forces
  std::optional<double> stiffness_margin;  ///< stiffness that the device alone can render at this rate, to
                                           ///< the scene's: b/(T (1/2 + delay))/K
  std::optional<double> rms_error_m;       ///< of position
  std::optional<double> latency_p99_ms;
  std::optional<double> bytes_per_s;  ///< on the wire, framing and TLS included
  bool advises = true;                ///< false: shown, but no choice follows from it (an extrapolation)
  std::string uncertainty;            ///< in words, with numbers; never empty
  std::string cannot_show;            ///< what this row says nothing about; never empty
};

using AccuracyRows = std::vector<AccuracyRow>;

/// Fills what a tick (or sample) costs at `rate_hz` of them a second: median, p99, share of a core, and
/// whether that fits.
void setTimes(AccuracyRow& row, const Timing& per_tick, double rate_hz);

/// The row as JSON: the columns of DESIGN §5 in their order, then the others; null where absent.
nlohmann::ordered_json jsonOf(const AccuracyRow& row);

/// Just noticeable difference at a force: 7 % from 2.5 N on (the literature: between 2.5 and 10 N); below
/// that people tell relatively less apart, the difference is held at 0.175 N. In N.
double noticeableForce_N(double force_N);

}  // namespace needlelab
