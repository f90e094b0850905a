/// One line of the headless instructor, for a person or as JSON.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "needlelab/live.pb.h"

namespace needlelab {

/// The newest sample of a frame, or a status line.
struct Update {
  double time_s =
      0;  ///< live: since the lesson's first tick; replay: since its first sample; overview: since it began
  std::string station, trainee, session;
  std::string phase;
  int layer = -1;          ///< from 0; −1 outside
  std::string layer_name;  ///< what people call it; empty: unknown, or outside
  double insertion_m = 0;
  double force_n = 0;
  std::optional<double> plunger;  ///< 0-1; frames only
  std::string syringe;            ///< "injecting", "aspirating", or empty (at rest, or unknown)
  std::uint32_t fault = 0;
  std::optional<double> latency_ms;    ///< from capture to receipt
  std::optional<std::uint64_t> drops;  ///< frames lost so far
  std::optional<bool> online;          ///< overviews only
  std::string trouble;                 ///< the station's message if it needs attention
  std::string server;                  ///< that has the station; empty: the lab has one server
};

/// `layer_names`: of the session's profile (common/profile/layer_names.h), if it is known.
Update updateOf(const GestureSample& sample, std::span<const std::string> layer_names = {});
/// Returns the plunger's action: "injecting" or "aspirating" if it moved between the samples at 0.02/s or
/// more, otherwise empty. `before` must be about 0.1 s to 1 s older, so that tremor does not count as a
/// stroke.
std::string syringeAction(const GestureSample& before, const GestureSample& now);
Update updateOf(const pb::StationStatus& status);

/// Returns aligned columns without a newline.
std::string textLine(const Update& update);
/// Returns one JSON object on one line, "type": "update".
std::string jsonLine(const Update& update);
/// Returns any other line; as JSON with "type": "note".
std::string noteLine(const std::string& text, bool json);
/// Returns the outcome of a command ("stop") as a note; as JSON with "said" and "ok".
std::string outcomeLine(const std::string& what, bool ok, const std::string& text, bool json);

/// Detects from a session's live samples whether the plunger is moving. Keeps a fifth of a second. Thread:
/// one.
class PlungerWatch {
 public:
  /// Adds the session's next sample. A sample older than the last, or much later, starts over.
  void add(const GestureSample& sample);
  /// Returns "injecting", "aspirating", or empty (see syringeAction) for the last 0.2 s.
  [[nodiscard]] std::string action() const;

 private:
  std::deque<GestureSample> kept_;  // at least 10 ms apart
  GestureSample newest_;
};

}  // namespace needlelab
