/// One line of the headless instructor, for a person or as JSON.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "needlelab/live.pb.h"

namespace needlelab {

/// The newest sample of a frame, or a status line.
struct Update {
  double time_s = 0;  ///< of the session
  std::string station, trainee, session;
  std::string phase;
  int layer = -1;
  double insertion_m = 0;
  double force_n = 0;
  std::optional<double> plunger;  ///< 0-1; frames only
  std::string syringe;            ///< "injecting", "aspirating", or empty: at rest, or not known
  std::uint32_t fault = 0;
  std::optional<double> latency_ms;    ///< from capture to receipt
  std::optional<std::uint64_t> drops;  ///< frames lost so far
  std::optional<bool> online;          ///< overviews
  std::string trouble;                 ///< what somebody should look at, in the station's words
};

Update updateOf(const GestureSample& sample);
/// What the plunger does: it went from one to the other sample's place at 0.02/s or more. `before` is to be
/// about 0.1 s to 1 s older, so that trembling is not taken for a stroke.
std::string syringeAction(const GestureSample& before, const GestureSample& now);
Update updateOf(const pb::StationStatus& status);

/// Aligned columns, without a newline.
std::string textLine(const Update& update);
/// One JSON object on one line, "type": "update".
std::string jsonLine(const Update& update);
/// Anything else that is worth a line: "type": "note".
std::string noteLine(const std::string& text, bool json);
/// What became of something that was to be said ("stop"): a note, as JSON with "said" and "ok".
std::string saidLine(const std::string& what, bool ok, const std::string& text, bool json);

}  // namespace needlelab
