/// The closing summary of a session: for a person and as JSON.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/effect_cost/calibration.h"
#include "client/net/spool_writer.h"
#include "client/net/uplink.h"
#include "client/station/run/black_box.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/run/real_time.h"
#include "client/station/run/servo_loop.h"

namespace needlelab {

/// The contents of a summary.
struct StationSummary {
  std::string session_id, station, trainee, exercise, profile, device;
  std::uint32_t profile_revision = 0;
  double rate_hz = 0;
  ServoStats servo;
  SpoolWriterCounts writer;
  std::uint64_t ring_dropped = 0;               ///< samples that found the ring full
  std::optional<std::uint64_t> lost_from_tick;  ///< the first lost sample's, when any is
  std::uint64_t samples_acked = 0;              ///< of this session, committed by the server
  std::uint64_t spool_left = 0;  ///< chunks in the spool that the server has not committed, over all sessions
  bool has_server = false;
  UplinkState uplink;
  std::string axial_model;  ///< by name, the one that was rendered
  std::vector<std::string> live_effects;
  std::vector<std::string> device_notes;  ///< what the device cannot do, and what was done instead
  std::optional<EffectCosts>
      effect_costs;  ///< of the live effects, measured before the loop; none when that failed
  std::vector<RtStep> realtime;
  BlackBoxCounts black_box;
  std::string state;         ///< COMPLETE, INTERRUPTED (the server's word), or OPEN
  std::string score_json;    ///< rows; empty when there is none
  std::string syringe_json;  ///< aspirations and injections, as of eventsJson; empty when not worked out
  std::string score_source;  ///< "server" or "station"
  std::string spool;
  std::optional<StopCause> stopped;  ///< by a person: at the window, or an instructor
};

/// Text for a bit of StepFlag or GateFlag; empty for bits without meaning.
std::string_view flagText(unsigned bit);
/// Whether a person should look at it (a limit was reached, a sample was refused), or it is an event of every
/// gesture.
bool isWarningFlag(unsigned bit);
const char* servoEndText(ServoEnd end);

/// "15.2 ns a tick; beside the others each adds: CUTTING 2.3 ns, …" or "15.2 ns a tick".
std::string effectCostsText(const EffectCosts& costs);

std::string summaryText(const StationSummary& summary);
/// {"version", "machine", "rows": [{…}]}: one row, which stands beside "rows" as well. `earlier` lessons of
/// the same program are rows before it.
std::string summaryJson(const StationSummary& summary, const std::vector<StationSummary>& earlier = {});
/// "stopped by ines: wrong side", "stopped at the window"; empty for nobody.
std::string stopText(const std::optional<StopCause>& stopped);

}  // namespace needlelab
