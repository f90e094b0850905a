#include "client/sim/accuracy/row.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

Json orNull(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}
Json orNull(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

// the price of a tick with its interval, then each condition's quantiles beside an empty call's
void addCost(Json& json, const AccuracyRow& row) {
  const std::optional<TickCost>& cost = row.cost;
  const TickCost c = cost.value_or(TickCost{});
  const auto put = [&](const std::string& key, double value) {
    json[key] = cost ? Json(value) : Json(nullptr);
  };
  const std::optional<CostInterval> price = cost ? std::optional(cost->cost_ns) : row.runs_ns;
  json["cost_ns"] = price ? Json(price->value) : Json(nullptr);
  json["cost_low_ns"] = price ? Json(price->low) : Json(nullptr);
  json["cost_high_ns"] = price ? Json(price->high) : Json(nullptr);
  put("tail_ns", c.tail_ns);
  const std::pair<const char*, const TickQuantiles*> kinds[] = {
      {"hot", &c.hot},         {"hot_empty", &c.hot_empty},
      {"flushed", &c.flushed}, {"flushed_empty", &c.flushed_empty},
      {"slept", &c.slept},     {"slept_empty", &c.slept_empty}};
  for (const auto& [kind, quantiles] : kinds) {
    put(std::string(kind) + "_p50_ns", quantiles->p50_ns);
    put(std::string(kind) + "_p99_ns", quantiles->p99_ns);
    put(std::string(kind) + "_p999_ns", quantiles->p999_ns);
  }
}

}  // namespace

void setCost(AccuracyRow& row, const TickCost& cost, double rate_hz) {
  row.cost = cost;
  row.median_ns = std::max(0.0, cost.hot.p50_ns - cost.hot_empty.p50_ns);
  row.p99_ns = cost.hot.p99_ns;
  row.cpu_share = cost.cost_ns.value * rate_hz * 1e-9;
  row.fits_rate = cost.tail_ns <= 1e9 / rate_hz;
}

Json jsonOf(const AccuracyRow& row) {
  Json json = {
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
      {"felt_stiffness_n_per_m", orNull(row.felt_stiffness_N_per_m)},
      {"noticeable_n", orNull(row.noticeable_n)},
      {"stiffness_margin", orNull(row.stiffness_margin)},
      {"rms_error_m", orNull(row.rms_error_m)},
      {"latency_p99_ms", orNull(row.latency_p99_ms)},
      {"bytes_per_s", orNull(row.bytes_per_s)},
      {"instructions", orNull(row.instructions)},
      {"precompute_s", orNull(row.precompute_s)},
  };
  addCost(json, row);
  json["votes"] = row.advises && !row.own_law;
  json["uncertainty"] = row.uncertainty;
  json["cannot_show"] = row.cannot_show;
  return json;
}

double noticeableForce_N(double force_N) {
  constexpr double kShare = 0.07, kLeastForce_N = 2.5;
  return kShare * std::max(std::abs(force_N), kLeastForce_N);
}

std::string spreadText(const ErrorRuns& runs, const char* of) {
  return fmt::format("rms ± {:.2g} N (sd over {} {})", runs.spread(), runs.runs(), of);
}

}  // namespace needlelab
