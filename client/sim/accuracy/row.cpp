#include "client/sim/accuracy/row.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

Json orNull(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}
Json orNull(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

}  // namespace

void setTimes(AccuracyRow& row, const Timing& per_tick, double rate_hz) {
  row.median_ns = per_tick.median_ns;
  row.p99_ns = per_tick.p99_ns;
  row.cpu_share = per_tick.median_ns * rate_hz * 1e-9;
  row.fits_rate = per_tick.p99_ns <= 1e9 / rate_hz;
}

Json jsonOf(const AccuracyRow& row) {
  return {
      {"study", nameOf(row.study)},
      {"scene", row.scene},
      {"model", orNull(row.model)},
      {"rate_hz", orNull(row.rate_hz)},
      {"mesh_nodes", orNull(row.mesh_nodes)},
      {"quantum_m", orNull(row.quantum_m)},
      {"frame_s", orNull(row.frame_s)},
      {"reference", row.reference},
      {"rms_error_n", orNull(row.rms_error_n)},
      {"max_error_n", orNull(row.max_error_n)},
      {"bytes_per_sample", orNull(row.bytes_per_sample)},
      {"latency_ms", orNull(row.latency_ms)},
      {"cpu_share", orNull(row.cpu_share)},
      {"median_ns", orNull(row.median_ns)},
      {"p99_ns", orNull(row.p99_ns)},
      {"fits_rate", row.fits_rate ? Json(*row.fits_rate) : Json(nullptr)},
      {"variant", orNull(row.variant)},
      {"parameters", orNull(row.parameters)},
      {"rms_error_spread_n", orNull(row.rms_error_spread_n)},
      {"max_step_n", orNull(row.max_step_n)},
      {"noticeable_n", orNull(row.noticeable_n)},
      {"stiffness_margin", orNull(row.stiffness_margin)},
      {"rms_error_m", orNull(row.rms_error_m)},
      {"latency_p99_ms", orNull(row.latency_p99_ms)},
      {"bytes_per_s", orNull(row.bytes_per_s)},
      {"uncertainty", row.uncertainty},
      {"cannot_show", row.cannot_show},
  };
}

double noticeableForce_N(double force_N) {
  constexpr double kShare = 0.07, kLeastForce_N = 2.5;
  return kShare * std::max(std::abs(force_N), kLeastForce_N);
}

std::string spreadText(const ErrorRuns& runs, const char* of) {
  return fmt::format("rms ± {:.2g} N (sd over {} {})", runs.spread(), runs.runs(), of);
}

}  // namespace needlelab
