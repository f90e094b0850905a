/// Made-up rows for the tests of the accuracy report.
#pragma once

#include <string>

#include "client/sim/accuracy/row.h"

namespace needlelab::test {

inline AccuracyRow modelRow(const std::string& model, double error_n, double median_ns, bool fits = true) {
  AccuracyRow row;
  row.study = AccuracyStudy::kModel;
  row.scene = "made-up scene";
  row.model = model;
  row.rate_hz = 1000;
  row.reference = "a made-up force";
  row.rms_error_n = error_n;
  row.median_ns = median_ns;
  row.p99_ns = 2 * median_ns;
  row.noticeable_n = 0.2;
  row.max_step_n = 0.01;
  row.fits_rate = fits;
  row.uncertainty = "none";
  row.cannot_show = "anything";
  return row;
}

/// A price with the range of its runs, in ns; nothing else is known of the ticks.
inline TickCost costOf(double value_ns, double low_ns, double high_ns) {
  TickCost cost;
  cost.cost_ns = {value_ns, low_ns, high_ns};
  return cost;
}

inline AccuracyRow rateRow(double rate_hz, double error_n, double margin) {
  AccuracyRow row = modelRow("ENHANCED_TRACKING_WALL", error_n, 100);
  row.study = AccuracyStudy::kRate;
  row.rate_hz = rate_hz;
  row.cpu_share = 100 * rate_hz * 1e-9;
  row.stiffness_margin = margin;
  return row;
}

inline AccuracyRow storageRow(double quantum_m, double error_n, double bytes) {
  AccuracyRow row = modelRow("", error_n, 100);
  row.study = AccuracyStudy::kStorage;
  row.quantum_m = quantum_m;
  row.bytes_per_sample = bytes;
  return row;
}

inline AccuracyRow liveRow(double frame_s, double p99_ms, double bytes_per_s) {
  AccuracyRow row = modelRow("", 0.01, 100);
  row.study = AccuracyStudy::kLive;
  row.frame_s = frame_s;
  row.latency_p99_ms = p99_ms;
  row.bytes_per_s = bytes_per_s;
  return row;
}

}  // namespace needlelab::test
