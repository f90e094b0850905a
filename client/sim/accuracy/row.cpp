#include "client/sim/accuracy/row.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "client/sim/tools/hand_thresholds.h"

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

Json orNull(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

}  // namespace

const ComparatorText& textOf(Comparator comparator) {
  static constexpr std::array<ComparatorText, kComparatorCount> kTexts = {{
      {"verification", "Verification: each model against its own closed form, between its jumps",
       "whether the engine computes a law as it is written, and what rate and encoder cost; not whether the "
       "law is that of tissue"},
      {"refinement", "Refinement: FEM with more stations and a finer mesh, at the same E",
       "how far a mesh is from the finest, and its price; not whether linear elasticity is that of tissue"},
      {"replay", "Replay: each model along recorded hands, against itself at 16 times the rate",
       "what a loop of 1 kHz and encoders of 10 µm cost in a hand's own motion; not which law is right, and "
       "the hand does not feel the force"},
  }};
  return kTexts[static_cast<std::size_t>(comparator)];
}

Json jsonOf(const AccuracyRow& row) {
  const auto error = [&](double MeanInterval::*value) {
    return row.error_N ? orNull((*row.error_N).*value) : Json(nullptr);
  };
  const auto time = [&](double LoopTimes::*value) {
    return row.time ? orNull((*row.time).*value) : Json(nullptr);
  };
  return {{"comparator", textOf(row.comparator).name},
          {"scene", row.scene},
          {"model", row.model},
          {"variant", row.variant.empty() ? Json(nullptr) : Json(row.variant)},
          {"against", row.against},
          {"rate_hz", orNull(row.rate_hz)},
          {"encoder_m", orNull(row.encoder_m)},
          {"nodes", orNull(row.nodes)},
          {"stations", orNull(row.stations)},
          {"error_n", error(&MeanInterval::mean)},
          {"error_low_n", error(&MeanInterval::low)},
          {"error_high_n", error(&MeanInterval::high)},
          {"error_count", row.error_N ? Json(row.error_N->count) : Json(nullptr)},
          {"greatest_n", orNull(row.greatest_N)},
          {"greatest_at", row.greatest_at.empty() ? Json(nullptr) : Json(row.greatest_at)},
          {"delay_s", orNull(row.delay_s)},
          {"beyond", orNull(row.beyond)},
          {"prepare_ms", row.prepare_s ? orNull(1e3 * *row.prepare_s) : Json(nullptr)},
          {"p50_ns", time(&LoopTimes::p50_ns)},
          {"p50_low_ns", time(&LoopTimes::low_ns)},
          {"p50_high_ns", time(&LoopTimes::high_ns)},
          {"p999_ns", time(&LoopTimes::p999_ns)},
          {"instructions", orNull(row.instructions)},
          {"margin", orNull(row.margin)},
          {"cannot_show", row.cannot_show}};
}

std::string nameOf(const AccuracyRow& row) {
  return row.variant.empty() ? row.model : row.model + ", " + row.variant;
}

double localLimit_N(double force_N) {
  constexpr double kShare = 0.07;
  return std::max(kShare * std::abs(force_N), kNoticeableStep_N);
}

void setError(AccuracyRow& row, const std::vector<ForceError>& gestures) {
  std::vector<double> rms_N;
  double beyond = 0, greatest_N = 0;
  for (const ForceError& one : gestures) {
    rms_N.push_back(one.rms_N());
    greatest_N = std::max(greatest_N, one.greatest_N());
    beyond += one.beyond() / static_cast<double>(gestures.size());
  }
  row.error_N = meanInterval(rms_N);
  row.error_N->low = std::max(0.0, row.error_N->low);
  row.greatest_N = greatest_N;
  row.beyond = beyond;
}

}  // namespace needlelab
