#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "common/base/csv.h"
#include "common/gesture/sample_csv.h"

namespace needlelab {
namespace {

/// Columns in the order of this list; reals first, then integers with their ranges.
const std::vector<std::string> kSampleCsvColumns = {
    "px_m",    "py_m", "pz_m",    "qx",    "qy",    "qz",      "qw",          "speed_m_s",
    "fx_n",    "fy_n", "fz_n",    "tx_nm", "ty_nm", "tz_nm",   "insertion_m", "lateral_error_m",
    "plunger", "tick", "time_ns", "phase", "layer", "buttons", "device_ns",   "engine_ns",
    "flags",   "fault"};

/// A whole number within a field's range.
template <typename Integer>
bool putInteger(double value, Integer& field) {
  using Limits = std::numeric_limits<Integer>;
  // the limits of 64 bits are no doubles; one step inside is
  if (value != std::floor(value) || value < static_cast<double>(Limits::lowest()) ||
      value >= static_cast<double>(Limits::max()) + (sizeof(Integer) < 8 ? 1 : 0))
    return false;
  field = static_cast<Integer>(value);
  return true;
}

}  // namespace

Result<std::vector<GestureSample>> readSampleCsv(const std::filesystem::path& path) {
  const auto table = readCsv(path, kSampleCsvColumns);
  if (!table) return table.error();
  std::vector<int> places;
  for (const std::string& name : kSampleCsvColumns) places.push_back(table->find(name));
  std::vector<GestureSample> samples(table->rows());
  for (std::size_t row = 0; row < samples.size(); ++row) {
    GestureSample& s = samples[row];
    std::size_t next = 0;
    const auto cell = [&] { return table->columns[static_cast<std::size_t>(places[next++])][row]; };
    for (double& v : s.p_WT_m) v = cell();
    for (double& v : s.q_WT) v = cell();
    s.speed_mps = cell();
    for (double& v : s.force_W_N) v = cell();
    for (double& v : s.torque_W_Nm) v = cell();
    s.insertion_m = cell();
    s.lateral_error_m = cell();
    s.plunger = cell();
    const auto put = [&](auto& field) { return putInteger(cell(), field); };
    if (put(s.tick) && put(s.time_ns) && put(s.phase) && put(s.layer) && put(s.buttons) && put(s.device_ns) &&
        put(s.engine_ns) && put(s.flags) && put(s.fault))
      continue;
    return Error{ErrorCode::kInvalidInput, path.string() + ", line " + std::to_string(row + 2) + ", column " +
                                               kSampleCsvColumns[next - 1] +
                                               ": no whole number in its range"};
  }
  return samples;
}

}  // namespace needlelab
