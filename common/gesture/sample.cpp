#include "common/gesture/sample.h"

#include <fmt/core.h>

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>

#include "common/base/text/csv.h"

namespace needlelab {

Status validate(const Resolution& resolution) {
  const struct {
    const char* name;
    double step;
  } fields[] = {{"length_m", resolution.length_m}, {"quaternion", resolution.quaternion},
                {"force_N", resolution.force_N},   {"torque_Nm", resolution.torque_Nm},
                {"time_s", resolution.time_s},     {"speed_mps", resolution.speed_mps}};
  for (const auto& field : fields) {
    // this form also rejects not-a-number
    if (field.step == 0 || (field.step >= 1e-12 && field.step <= 1)) continue;
    std::string text = std::string("resolution.") + field.name + " is ";
    appendNumber(text, field.step);
    return Error{ErrorCode::kInvalidInput, text + "; allowed is 0 (lossless) or 1e-12 to 1"};
  }
  return {};
}

namespace {

// calls `cell(name, value)` for each column in order; the value is a double or an integer
template <typename Cell>
void forEachColumn(const GestureSample& s, std::int64_t first_time_ns, Cell cell) {
  const std::uint64_t ns = static_cast<std::uint64_t>(s.time_ns) - static_cast<std::uint64_t>(first_time_ns);
  cell("t_s", static_cast<double>(static_cast<std::int64_t>(ns)) / 1e9);
  cell("tick", s.tick);
  cell("time_ns", s.time_ns);
  cell("px_m", s.p_WT_m[0]);
  cell("py_m", s.p_WT_m[1]);
  cell("pz_m", s.p_WT_m[2]);
  cell("qx", s.q_WT[0]);
  cell("qy", s.q_WT[1]);
  cell("qz", s.q_WT[2]);
  cell("qw", s.q_WT[3]);
  cell("speed_m_s", s.speed_mps);
  cell("fx_n", s.force_W_N[0]);
  cell("fy_n", s.force_W_N[1]);
  cell("fz_n", s.force_W_N[2]);
  cell("tx_nm", s.torque_W_Nm[0]);
  cell("ty_nm", s.torque_W_Nm[1]);
  cell("tz_nm", s.torque_W_Nm[2]);
  cell("wx_m", s.wall_W_m[0]);
  cell("wy_m", s.wall_W_m[1]);
  cell("wz_m", s.wall_W_m[2]);
  cell("phase", s.phase);
  cell("layer", s.layer);
  cell("insertion_m", s.insertion_m);
  cell("lateral_error_m", s.lateral_error_m);
  cell("plunger", s.plunger);
  cell("buttons", s.buttons);
  cell("device_ns", s.device_ns);
  cell("engine_ns", s.engine_ns);
  cell("flags", s.flags);
  cell("fault", s.fault);
}

template <typename Integer>
void appendInteger(std::string& out, Integer value) {
  char text[24];
  const auto [end, error] = std::to_chars(text, text + sizeof text, +value);
  (void)error;  // 24 characters hold any 64-bit integer
  out.append(text, end);
}

/// Columns in the order of this list; reals first, then integers with their ranges.
const std::vector<std::string> kSampleCsvColumns = {
    "px_m",    "py_m", "pz_m",    "qx",    "qy",    "qz",      "qw",          "speed_m_s",
    "fx_n",    "fy_n", "fz_n",    "tx_nm", "ty_nm", "tz_nm",   "insertion_m", "lateral_error_m",
    "plunger", "tick", "time_ns", "phase", "layer", "buttons", "device_ns",   "engine_ns",
    "flags",   "fault"};
const std::vector<std::string> kWallCsvColumns = {"wx_m", "wy_m", "wz_m"};

/// A whole number within a field's range.
template <typename Integer>
bool putInteger(double value, Integer& field) {
  using Limits = std::numeric_limits<Integer>;
  // the limits of 64 bits cannot be represented as doubles; one step inside they can
  if (value != std::floor(value) || value < static_cast<double>(Limits::lowest()) ||
      value >= static_cast<double>(Limits::max()) + (sizeof(Integer) < 8 ? 1 : 0))
    return false;
  field = static_cast<Integer>(value);
  return true;
}

}  // namespace

void appendSampleCsvHeader(std::string& out) {
  bool first = true;
  forEachColumn(GestureSample{}, 0, [&](const char* name, auto) {
    if (!first) out += ',';
    first = false;
    out += name;
  });
  out += '\n';
}

void appendSampleCsvRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) {
  bool first = true;
  forEachColumn(sample, first_time_ns, [&](const char*, auto value) {
    if (!first) out += ',';
    first = false;
    if constexpr (std::is_floating_point_v<decltype(value)>)
      appendNumber(out, value);
    else
      appendInteger(out, value);
  });
  out += '\n';
}

void appendSampleJson(std::string& out, const GestureSample& sample, std::int64_t first_time_ns) {
  char separator = '{';
  forEachColumn(sample, first_time_ns, [&](const char* name, auto value) {
    out += separator;
    separator = ',';
    out += '"';
    out += name;
    out += "\":";
    if constexpr (std::is_floating_point_v<decltype(value)>) {
      if (std::isfinite(value))
        appendNumber(out, value);
      else
        out += "null";
    } else {
      appendInteger(out, value);
    }
  });
  out += '}';
}

Result<std::vector<GestureSample>> readSampleCsv(const std::filesystem::path& path, WallColumns wall) {
  std::vector<std::string> names = kSampleCsvColumns;
  if (wall == WallColumns::kRead) names.insert(names.end(), kWallCsvColumns.begin(), kWallCsvColumns.end());
  ASSIGN_OR_RETURN(const auto table, readCsv(path, names, {}, {.not_finite = kWallCsvColumns}));
  std::vector<int> places;
  for (const std::string& name : names) places.push_back(table.find(name));
  std::vector<GestureSample> samples(table.rows());
  for (std::size_t row = 0; row < samples.size(); ++row) {
    GestureSample& s = samples[row];
    std::size_t next = 0;
    const auto cell = [&] { return table.columns[static_cast<std::size_t>(places[next++])][row]; };
    for (double& v : s.p_WT_m) v = cell();
    for (double& v : s.q_WT) v = cell();
    s.speed_mps = cell();
    for (double& v : s.force_W_N) v = cell();
    for (double& v : s.torque_W_Nm) v = cell();
    s.insertion_m = cell();
    s.lateral_error_m = cell();
    s.plunger = cell();
    const auto put = [&](auto& field) { return putInteger(cell(), field); };
    if (!(put(s.tick) && put(s.time_ns) && put(s.phase) && put(s.layer) && put(s.buttons) &&
          put(s.device_ns) && put(s.engine_ns) && put(s.flags) && put(s.fault)))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("{}, line {}, column {}: no whole number in its range", path.string(), row + 2,
                               names[next - 1])};
    if (wall == WallColumns::kRead)
      for (double& v : s.wall_W_m) v = cell();
  }
  return samples;
}

}  // namespace needlelab
