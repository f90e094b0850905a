/// One line of the headless instructor, for a person or as JSON.
#pragma once

#include <deque>
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
  std::string trouble;                 ///< the station's message, when somebody should look at it
};

Update updateOf(const GestureSample& sample);
/// The plunger's action: "injecting" or "aspirating" when it moved between the samples at 0.02/s or more,
/// else empty. `before` must be about 0.1 s to 1 s older, so that trembling does not count as a stroke.
std::string syringeAction(const GestureSample& before, const GestureSample& now);
Update updateOf(const pb::StationStatus& status);

/// Aligned columns, without a newline.
std::string textLine(const Update& update);
/// One JSON object on one line, "type": "update".
std::string jsonLine(const Update& update);
/// Any other line: "type": "note".
std::string noteLine(const std::string& text, bool json);
/// The outcome of a command ("stop"): a note, as JSON with "said" and "ok".
std::string outcomeLine(const std::string& what, bool ok, const std::string& text, bool json);

/// Tells from a session's samples, as they come, whether the plunger is moving now. Remembers a fifth of a
/// second. Thread: one.
class PlungerWatch {
 public:
  /// The next sample of the session; one that is older than the last, or much later, starts over.
  void add(const GestureSample& sample);
  /// "injecting", "aspirating", or empty (see syringeAction), over the last 0.2 s.
  [[nodiscard]] std::string action() const;

 private:
  std::deque<GestureSample> kept_;  // at least 10 ms apart
  GestureSample newest_;
};

}  // namespace needlelab
