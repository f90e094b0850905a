/// One tick of a gesture, as recorded, and the steps to which its columns are rounded when they are stored
/// (FORMAT.md); samples as text for other programs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Units as named. W is the device's base frame. NaN is allowed in `wall_W_m` only ("no wall").
struct GestureSample {
  std::uint64_t tick = 0;  ///< tick of the station's loop, missed ticks included; never rewritten
  std::int64_t time_ns =
      0;                  ///< station steady clock when the tick was due to start its work; never rewritten
  double p_WT_m[3] = {};  ///< tip
  double q_WT[4] = {0, 0, 0, 1};  ///< x y z w, unit
  double speed_mps = 0;           ///< of the tip along the trajectory over 100 ms (engine's v); 0 when free
  double force_W_N[3] = {};       ///< on the hand, after the gate
  double torque_W_Nm[3] = {};     ///< about the tip, after the gate
  double wall_W_m[3] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN(),
                        std::numeric_limits<double>::quiet_NaN()};  ///< P0 + u·w
  double insertion_m = 0;                                           ///< d_t
  double lateral_error_m = 0;                                       ///< |e|
  double plunger = 0;                                               ///< 0-1
  std::int32_t device_ns = 0;  ///< time spent in the device's read and write in this tick
  std::int32_t engine_ns = 0;  ///< time spent in the engine and gate in this tick
  std::uint32_t flags = 0;     ///< StepFlag | GateFlag
  std::uint32_t buttons = 0;   ///< bit i: button i is pressed
  std::int8_t layer = -1;      ///< the profile's layer or the volume's structure; −1 when free
  std::uint8_t phase = 0;      ///< needlelab::Phase
  std::uint8_t fault = 0;      ///< needlelab::Fault
};
static_assert(std::is_trivially_copyable_v<GestureSample>);

/// One step for each kind of column. The stored error is at most half a step in every value; a step of 0
/// stores the kind's raw double bits (lossless). The tick number and `time_ns` are always exact.
struct Resolution {
  double length_m = 1e-6;       ///< tip, wall, insertion, lateral error
  double quaternion = 0x1p-15;  ///< the four components; also `plunger`, which is also dimensionless
  double force_N = 1e-3;
  double torque_Nm = 1e-4;
  double time_s = 1e-6;  ///< device and engine time of a tick; below 1 ns it means 1 ns, which is exact
  double speed_mps = 1e-4;

  static Resolution standard() { return {}; }
  static Resolution lossless() { return {0, 0, 0, 0, 0, 0}; }
  friend bool operator==(const Resolution&, const Resolution&) = default;
};

/// Every step must be 0 or within [1e-12, 1]. Errors (kInvalidInput) name the field, the value and the range.
Status validate(const Resolution& resolution);

// --- samples as text for other programs: CSV rows, or one JSON object per sample

/// `t_s,tick,time_ns,px_m,…,fault` and a line feed. Column names carry their unit. Stable: columns are only
/// added at the end.
void appendSampleCsvHeader(std::string& out);

/// One row and a line feed; a number reads back as the same double, `nan` is not-a-number. `first_time_ns` is
/// the time of the recording's first sample: t_s is the difference of the integer times, so that it is exact
/// to the nanosecond.
void appendSampleCsvRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns);

/// The same row for a spreadsheet: rounded to the decimals of its column's standard resolution, t_s and
/// lengths to 1e-6, forces to 1e-3; the cell of not-a-number is empty.
void appendRoundedCsvRow(std::string& out, const GestureSample& sample, std::int64_t first_time_ns);

/// One JSON object with the CSV's names as keys, no line feed; not-a-number and infinities become null,
/// because JSON does not have them.
void appendSampleJson(std::string& out, const GestureSample& sample, std::int64_t first_time_ns);

/// Whether the wall's columns are required and read. Scores do not need them.
enum class WallColumns : std::uint8_t { kIgnored, kRead };

/// Reads the samples of an exported CSV. A wall that is left out is NaN; time_ns is exact up to 2^53 ns. If a
/// spreadsheet rounded time_ns, times come from t_s, and `note` says so to people.
/// Errors: those of readCsv; kInvalidInput naming line and column, when a cell does not fit its column.
Result<std::vector<GestureSample>> readSampleCsv(const std::filesystem::path& path,
                                                 WallColumns wall = WallColumns::kIgnored,
                                                 std::string* note = nullptr);

}  // namespace needlelab
