#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "client/device/hand/hand.h"
#include "client/sim/accuracy/closed_form.h"
#include "client/sim/accuracy/study.h"
#include "common/haptics/engine.h"

namespace needlelab {
namespace {

constexpr char kScene[] = "three layers, straight in and out";
constexpr std::array<double, 5> kRates_hz = {250, 500, 1000, 2000, 4000};
constexpr std::array<double, 3> kEncoders_m = {1e-6, 1e-5, 5e-5};
constexpr int kPartsOfTick = 4;  // a force is held for a tick, while the needle moves on

AccuracyRow rowOf(AxialModel model, const std::string& variant, std::string_view scene) {
  AccuracyRow row;
  row.comparator = Comparator::kVerification;
  row.scene = scene;
  row.model = axialModelName(model);
  row.variant = variant;
  return row;
}

// Compares the mean force of many insertions at a depth with the table's.
Result<AccuracyRow> statisticalRow(int insertions) {
  constexpr double kDepth_m = 0.02, kStep_m = 1e-4, kMean_N = 2, kSd_N = 0.4;
  SceneSpec scene = closedForms().front().scene;
  scene.axial_model = AxialModel::kStatistical;
  scene.statistical.table = {{0, kMean_N, kSd_N}, {0.1, kMean_N, kSd_N}};
  AccuracyRow row = rowOf(AxialModel::kStatistical, "", "one depth, many insertions");
  std::vector<double> off_N;
  for (int i = 0; i < insertions; ++i) {
    scene.statistical.seed = 1 + static_cast<std::uint64_t>(i);
    ASSIGN_OR_RETURN(const auto model, compile(scene, kStationRate_hz));
    SimState state{};
    StepReport report;
    for (double depth_m = -kStep_m; depth_m < kDepth_m; depth_m += kStep_m)
      step(model, straightTip(depth_m), state, report);
    off_N.push_back(-report.cutting_N - kMean_N);
  }
  const MeanInterval mean = meanInterval(off_N);
  row.error_N =
      MeanInterval{std::abs(mean.mean), std::max(0.0, std::abs(mean.mean) - (mean.high - mean.mean)),
                   std::abs(mean.mean) + (mean.high - mean.mean), mean.count};
  row.rate_hz = kStationRate_hz;
  row.against = fmt::format("the mean of its table, {} N, over {} insertions", kMean_N, insertions);
  row.cannot_show =
      "a single insertion: the law is a distribution, so only the mean over insertions has a formula, and no "
      "tick can be right or wrong";
  return row;
}

}  // namespace

std::vector<TurnGesture> turnGestures(int count) {
  std::vector<TurnGesture> gestures;
  for (int seed = 1; seed <= count; ++seed) {
    HandRandom random(static_cast<std::uint64_t>(seed));
    const auto between = [&](double low, double high) { return low + (high - low) * random.uniform(); };
    TurnGesture gesture;
    gesture.from_m = between(0.001, 0.002);
    gesture.deepest_m = between(0.0245, 0.0275);
    gesture.speed_mps = between(0.005, 0.02);
    gestures.push_back(gesture);
  }
  return gestures;
}

namespace {

double forceAt_N(const ClosedForm& form, const TurnGesture& gesture, double t_s) {
  const double depth_m = gesture.depth_m(t_s);
  return depth_m > 0 ? form.force_N(gesture, depth_m, t_s >= gesture.turn_s()) : 0;
}

}  // namespace

std::vector<double> jumpsOf(const ClosedForm& form, const TurnGesture& gesture) {
  constexpr double kStep_s = 1e-4, kJump_N = 0.01;  // the steepest slope is 1.6 mN in a step
  std::vector<double> jumps_s;
  const auto change_N = [&](double from_s, double to_s) {
    return std::abs(forceAt_N(form, gesture, to_s) - forceAt_N(form, gesture, from_s));
  };
  for (double t_s = 0; t_s < gesture.seconds(); t_s += kStep_s) {
    double from_s = t_s, to_s = t_s + kStep_s;
    if (change_N(from_s, to_s) < kJump_N) continue;
    for (int i = 0; i < 30; ++i) {
      const double middle_s = 0.5 * (from_s + to_s);
      (change_N(from_s, middle_s) > change_N(middle_s, to_s) ? to_s : from_s) = middle_s;
    }
    jumps_s.push_back(to_s);
  }
  return jumps_s;
}

Result<FormulaError> errorOf(const ClosedForm& rendered, const ClosedForm& right, const TurnGesture& gesture,
                             double rate_hz, double encoder_m) {
  ASSIGN_OR_RETURN(const auto model, compile(rendered.scene, rate_hz));
  SimState state{};
  StepReport report;
  FormulaError error;
  const std::vector<double> jumps_s = jumpsOf(right, gesture);
  const double near_s = 2 / rate_hz + 0.5 * encoder_m / gesture.speed_mps;
  auto next = jumps_s.begin();  // the engine has shown all before it
  const auto ticks = static_cast<std::size_t>(gesture.seconds() * rate_hz);
  for (std::size_t k = 0; k < ticks; ++k) {
    const auto tick = static_cast<double>(k);
    const double depth_m = gesture.depth_m(tick / rate_hz);
    const double read_m = encoder_m > 0 ? encoder_m * std::floor(depth_m / encoder_m + 0.5) : depth_m;
    step(model, straightTip(read_m), state, report);
    const double force_N = axialForce_N(report);
    if (next != jumps_s.end() && tick / rate_hz >= *next) {
      constexpr double kBeside_s = 1e-9;
      const double jump_N =
          forceAt_N(right, gesture, *next + kBeside_s) - forceAt_N(right, gesture, *next - kBeside_s);
      const double off_N = force_N - forceAt_N(right, gesture, tick / rate_hz);
      const bool shown = std::abs(off_N) < std::abs(off_N + jump_N);
      if (shown || k + 1 == ticks)
        error.delay_s = std::max(error.delay_s.value_or(0), tick / rate_hz - *next++);
    }
    for (int part = 0; part < kPartsOfTick; ++part) {
      const double t_s = (tick + (part + 0.5) / kPartsOfTick) / rate_hz;
      if (gesture.depth_m(t_s) > 0 && std::none_of(jumps_s.begin(), jumps_s.end(), [&](double jump_s) {
            return std::abs(t_s - jump_s) <= near_s;
          }))
        error.between.add(force_N, forceAt_N(right, gesture, t_s));
    }
  }
  return error;
}

Result<AccuracyRows> verificationRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& /*notes*/) {
  const std::vector<TurnGesture> gestures = turnGestures(options.long_form ? 32 : 8);
  AccuracyRows rows;
  for (std::size_t m = 0; m < closedForms().size(); ++m) {
    const ClosedForm& form = closedForms()[m];
    progress(axialModelName(form.model), static_cast<double>(m) / static_cast<double>(closedForms().size()));
    for (const double rate_hz : kRates_hz)
      for (const double encoder_m : kEncoders_m) {
        AccuracyRow row = rowOf(form.model, form.variant, kScene);
        row.rate_hz = rate_hz;
        row.encoder_m = encoder_m;
        row.against =
            "the law as a formula of depth (FORCE_MODEL.md), at each moment of the held force, between its jumps";
        std::vector<ForceError> errors;
        for (const TurnGesture& gesture : gestures) {
          ASSIGN_OR_RETURN(const auto error, errorOf(form, form, gesture, rate_hz, encoder_m));
          errors.push_back(error.between);
          if (error.delay_s) row.delay_s = std::max(row.delay_s.value_or(0), *error.delay_s);
        }
        setError(row, errors);
        row.cannot_show = "whether the law is that of tissue";
        if (!form.leaves_out.empty()) row.cannot_show += "; " + form.leaves_out;
        rows.push_back(std::move(row));
      }
  }
  ASSIGN_OR_RETURN(auto statistical, statisticalRow(options.long_form ? 1000 : 200));
  rows.push_back(std::move(statistical));
  return rows;
}

}  // namespace needlelab
