/// One line of the headless instructor, for a person or as JSON.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "common/gesture/sample.h"
#include "needlelab/live.pb.h"

namespace needlelab {

/// The newest sample of a frame, or a status line.
struct Update {
  double time_s =
      0;  ///< live: since the lesson's first tick; replay: since its first sample; overview: since it started
  std::string station, trainee, session;
  std::string phase;
  int layer = -1;          ///< from 0; −1 outside
  std::string layer_name;  ///< for people; empty: unknown, or outside
  double insertion_m = 0;
  double force_n = 0;
  std::optional<double> plunger;  ///< 0-1; frames only
  std::uint32_t fault = 0;
  std::optional<double> latency_ms;    ///< from capture to receipt
  std::optional<std::uint64_t> drops;  ///< frames lost so far
  std::optional<bool> online;          ///< overviews only
  std::string trouble;                 ///< the station's message if it needs attention
  std::string server;                  ///< of this station; empty if the lab has only one server
};

/// `layer_names`: of the session's profile (common/profile/layer_names.h), if it is known.
Update updateOf(const GestureSample& sample, std::span<const std::string> layer_names = {});
Update updateOf(const pb::StationStatus& status);

/// Returns aligned columns without a newline.
std::string textLine(const Update& update);
/// Returns one JSON object on one line, "type": "update".
std::string jsonLine(const Update& update);
/// Returns any other line; as JSON with "type": "note".
std::string noteLine(const std::string& text, bool json);

}  // namespace needlelab
