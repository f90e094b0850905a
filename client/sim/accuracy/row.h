/// A row of the accuracy report: a model in a comparator, its error, and the cost of its tick.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/tools/small_sample.h"

namespace needlelab {

/// The reference for a model's force. Each shows something different; none of them ranks models for tissue.
enum class Comparator : std::uint8_t {
  kVerification,  ///< its own closed form: is the law computed as written
  kRefinement,    ///< FEM with more stations and a finer mesh, at the same E
  kReplay,        ///< itself at 16 times the rate, along a recorded hand
};
inline constexpr std::size_t kComparatorCount = 3;

/// Its name on the command line, its title, and what it shows.
struct ComparatorText {
  std::string_view name, title, shows;
};
const ComparatorText& textOf(Comparator comparator);

/// Durations of a tick's computation (tool, gate and engine) in the station's loop, in ns.
struct LoopTimes {
  double p50_ns = 0, low_ns = 0, high_ns = 0;  ///< with its range over the rounds; see printAsEqual
  double p999_ns = 0;
};

/// Missing values are empty, and null in JSON.
struct AccuracyRow {
  Comparator comparator = Comparator::kVerification;
  std::string scene;    ///< e.g. "three layers"
  std::string model;    ///< a name of kAxialModelNames
  std::string variant;  ///< of the model; empty for the default
  std::string against;  ///< reference of the error, never empty
  std::optional<double> rate_hz, encoder_m, nodes, stations;
  /// RMS of force, with its 95 % interval over gestures or recordings; infinite bounds if
  /// there is one value only. Of the verification: between the formula's jumps.
  std::optional<MeanInterval> error_N;
  std::optional<double> greatest_N;  ///< the greatest error of those
  std::string greatest_at;           ///< where on the gesture; may be empty
  std::optional<double> delay_s;     ///< the greatest, from a jump of the formula until the engine shows it
  std::optional<double> prepare_s;   ///< FEM: mesh and compliance, before the lesson
  std::optional<double> beyond;      ///< share of ticks with an error that a hand may notice (ForceError)
  std::optional<LoopTimes> time;
  std::optional<double> instructions;  ///< per tick, mean over a gesture
  std::optional<double> margin;        ///< stiffness that the device alone can render, relative to the
                                       ///< scene's
  std::string cannot_show;             ///< limits of this row's evidence, never empty
};
using AccuracyRows = std::vector<AccuracyRow>;

/// Returns the row as JSON: its columns in order, null where missing.
nlohmann::ordered_json jsonOf(const AccuracyRow& row);

/// "VOIGT, adaptive window".
std::string nameOf(const AccuracyRow& row);

/// 7 % of the local force, in N, but at least the step that a hand notices at low force.
double localLimit_N(double force_N);

/// Accumulates the errors of one gesture.
class ForceError {
 public:
  void add(double force_N, double right_N) {
    const double off_N = force_N - right_N;
    squares_ += off_N * off_N;
    greatest_N_ = std::max(greatest_N_, std::abs(off_N));
    if (std::abs(off_N) > localLimit_N(right_N)) ++beyond_;
    ++count_;
  }
  [[nodiscard]] double rms_N() const {
    return count_ > 0 ? std::sqrt(squares_ / static_cast<double>(count_)) : 0;
  }
  [[nodiscard]] double beyond() const {
    return count_ > 0 ? static_cast<double>(beyond_) / static_cast<double>(count_) : 0;
  }
  [[nodiscard]] double greatest_N() const { return greatest_N_; }
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  double squares_ = 0, greatest_N_ = 0;
  std::size_t beyond_ = 0, count_ = 0;
};

/// Sets error, greatest error and share from one sum per gesture, equally weighted. Requires at least one.
void setError(AccuracyRow& row, const std::vector<ForceError>& gestures);

}  // namespace needlelab
