#include "common/gesture/sample_csv.h"

#include <charconv>
#include <cmath>

#include "common/base/csv.h"

namespace needlelab {
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

}  // namespace needlelab
