/// The closing summary of a session: for a person and as JSON.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/net/spool/spool_writer.h"
#include "client/net/uplink/uplink.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/run/loop/black_box.h"
#include "client/station/run/loop/real_time.h"
#include "client/station/run/loop/servo_loop.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/scoring/alarms/alarms.h"
#include "common/scoring/targets/miss.h"

namespace needlelab {

/// The contents of a summary.
struct StationSummary {
  std::string session_id, station, trainee, exercise, profile, device;
  std::uint32_t profile_revision = 0;
  double rate_hz = 0;
  ServoStats servo;
  SpoolWriterCounts writer;
  std::uint64_t ring_dropped = 0;               ///< samples refused by a full ring
  std::optional<std::uint64_t> lost_from_tick;  ///< tick of the first lost sample, if any
  std::uint64_t samples_acked = 0;              ///< samples of this session that the server committed
  std::uint64_t spool_left = 0;                 ///< uncommitted chunks in the spool, over all sessions
  bool has_server = false;
  UplinkState uplink;
  std::string axial_model;  ///< name of the rendered model
  std::vector<std::string> live_effects;
  std::vector<std::string> device_notes;  ///< the device's limits, and the substitutes for them
  std::vector<AlarmCount> alarms;         ///< of the gesture
  StiffnessShares shares;                 ///< as in SessionDescription
  EffectMask left_out = 0;                ///< as in StationLesson
  std::vector<RtStep> realtime;
  BlackBoxCounts black_box;
  std::string state;         ///< COMPLETE, INTERRUPTED (the server's word), or OPEN
  std::string score_json;    ///< rows; empty: no score
  std::string syringe_json;  ///< aspirations and injections, as in eventsJson; empty: not computed
  std::string score_source;  ///< "server" or "station"
  std::optional<Miss> miss;  ///< computed by the station; none without a target or an insertion
  /// Exam: when its results are shown; before that, there is neither score nor syringe here. 0: they are
  /// shown.
  std::int64_t results_from_unix_ns = 0;
  std::string spool;
  std::optional<StopCause> stopped;  ///< stop by a person at the window or by an instructor
};

/// Returns the text for a bit of StepFlag or GateFlag; empty for unused bits.
std::string_view flagText(unsigned bit);
/// Returns true if the flag needs a person's attention (a limit was reached, a sample was refused), false if
/// it is an ordinary event of a gesture.
bool isWarningFlag(unsigned bit);
const char* servoEndText(ServoEnd end);

std::string summaryText(const StationSummary& summary);
/// Returns {"version", "machine", "rows": [{…}]}, with one row for this lesson; its fields also stand at the
/// top level. The `earlier` lessons of the same program are the rows before it.
std::string summaryJson(const StationSummary& summary, const std::vector<StationSummary>& earlier = {});
/// "Your result is shown from 3 June 2026, 14:00 on."
std::string resultsText(std::int64_t results_from_unix_ns);
/// Returns e.g. "stopped by ines: wrong side" or "stopped at the window"; empty if no one stopped it.
std::string stopText(const std::optional<StopCause>& stopped);

}  // namespace needlelab
