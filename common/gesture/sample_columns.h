/// The columns of a sample as other programs get it: CSV, JSON, HDF5 and Motion-BIDS follow from this table.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/gesture/sample.h"

namespace needlelab {

struct SampleColumn {
  const char* name;          ///< stable
  const char* unit;          ///< "1": a share, a code, bits
  const char* component;     ///< of a vector or quaternion in the frame W, in words of Motion-BIDS; or "n/a"
  double Resolution::*step;  ///< to which stored values are rounded, in SI; null: exact
  const char* description;
  [[nodiscard]] bool inFrame() const { return component != std::string_view("n/a"); }
};

/// Calls `cell(column, value)` for each column, in the order of the CSV; columns are only added at the end. A
/// value is a double or an integer, the sample's own but for t_s. `first_time_ns`: of the recording.
template <typename Sample, typename Cell>
void forEachSampleColumn(Sample& s, std::int64_t first_time_ns, Cell cell) {
  using C = SampleColumn;
  using R = Resolution;
  constexpr char kNone[] = "n/a", kQuaternion[] = "rotation of the needle, unit quaternion",
                 kForce[] = "force on the hand", kTorque[] = "torque on the hand, about the tip",
                 kWall[] = "the wall's point; not a number when free",
                 kFormat[] = "codes: common/gesture/FORMAT.md of needlelab";
  const std::uint64_t ns = static_cast<std::uint64_t>(s.time_ns) - static_cast<std::uint64_t>(first_time_ns);
  double t_s = static_cast<double>(static_cast<std::int64_t>(ns)) / 1e9;
  cell(C{"t_s", "s", kNone, nullptr, "time since the recording's first sample"}, t_s);
  cell(C{"tick", "1", kNone, nullptr, "number of the loop's tick, missed ticks included"}, s.tick);
  cell(C{"time_ns", "ns", kNone, nullptr, "the station's clock when the tick was due"}, s.time_ns);
  cell(C{"px_m", "m", "x", &R::length_m, "the needle's tip"}, s.p_WT_m[0]);
  cell(C{"py_m", "m", "y", &R::length_m, "the needle's tip"}, s.p_WT_m[1]);
  cell(C{"pz_m", "m", "z", &R::length_m, "the needle's tip"}, s.p_WT_m[2]);
  cell(C{"qx", "1", "quat_x", &R::quaternion, kQuaternion}, s.q_WT[0]);
  cell(C{"qy", "1", "quat_y", &R::quaternion, kQuaternion}, s.q_WT[1]);
  cell(C{"qz", "1", "quat_z", &R::quaternion, kQuaternion}, s.q_WT[2]);
  cell(C{"qw", "1", "quat_w", &R::quaternion, kQuaternion}, s.q_WT[3]);
  cell(C{"speed_m_s", "m/s", kNone, &R::speed_mps, "of the tip along the trajectory"}, s.speed_mps);
  cell(C{"fx_n", "N", "x", &R::force_N, kForce}, s.force_W_N[0]);
  cell(C{"fy_n", "N", "y", &R::force_N, kForce}, s.force_W_N[1]);
  cell(C{"fz_n", "N", "z", &R::force_N, kForce}, s.force_W_N[2]);
  cell(C{"tx_nm", "N.m", "x", &R::torque_Nm, kTorque}, s.torque_W_Nm[0]);
  cell(C{"ty_nm", "N.m", "y", &R::torque_Nm, kTorque}, s.torque_W_Nm[1]);
  cell(C{"tz_nm", "N.m", "z", &R::torque_Nm, kTorque}, s.torque_W_Nm[2]);
  cell(C{"wx_m", "m", "x", &R::length_m, kWall}, s.wall_W_m[0]);
  cell(C{"wy_m", "m", "y", &R::length_m, kWall}, s.wall_W_m[1]);
  cell(C{"wz_m", "m", "z", &R::length_m, kWall}, s.wall_W_m[2]);
  cell(C{"phase", "1", kNone, nullptr, "0 free, 1 inserting, 2 stopped, 3 withdrawing"}, s.phase);
  cell(C{"layer", "1", kNone, nullptr, "in the profile's order, 0 the first; -1 when free"}, s.layer);
  cell(C{"insertion_m", "m", kNone, &R::length_m, "inserted length"}, s.insertion_m);
  cell(C{"lateral_error_m", "m", kNone, &R::length_m, "from tip to trajectory"}, s.lateral_error_m);
  cell(C{"plunger", "1", kNone, &R::quaternion, "0 drawn out, 1 pressed down"}, s.plunger);
  cell(C{"buttons", "1", kNone, nullptr, "bit i: the device's button i is pressed"}, s.buttons);
  cell(C{"device_ns", "ns", kNone, &R::time_s, "the tick's time for the device"}, s.device_ns);
  cell(C{"engine_ns", "ns", kNone, &R::time_s, "the tick's time for engine and gate"}, s.engine_ns);
  cell(C{"flags", "1", kNone, nullptr, kFormat}, s.flags);
  cell(C{"fault", "1", kNone, nullptr, kFormat}, s.fault);
}

/// As appendSampleCsvRow, with other signs.
void appendSampleRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns,
                     char separator, std::string_view not_a_number);

}  // namespace needlelab
