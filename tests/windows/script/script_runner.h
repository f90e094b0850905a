/// Runs a script, one action after another, between frames.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/screens/instructor_window.h"
#include "tests/windows/script/script.h"

namespace needlelab {

/// Thread: the surface's.
class ScriptRunner {
 public:
  /// `name`: the file's name, for messages. `print`: output of the actions print, latency and frames.
  ScriptRunner(std::vector<ScriptAction> actions, std::string name,
               std::function<void(const std::string&)> print);

  /// Call it after each frame. Runs at most one non-waiting action per frame.
  void afterFrame(InstructorWindow& window);
  /// Returns whether the script ended: all actions done, `quit`, or a failure.
  [[nodiscard]] bool over() const { return over_; }
  /// Returns "tour:7: expect \"…\": …" after a failure.
  [[nodiscard]] const Status& status() const { return status_; }

 private:
  /// Returns whether the action is done; an error ends the script.
  Result<bool> act(const ScriptAction& action, InstructorWindow& window, bool first);
  Result<bool> actOnLink(const ScriptAction& action, InstructorWindow& window, bool first);
  Result<bool> actOnLab(const ScriptAction& action, InstructorWindow& window, bool first);
  Result<bool> actOnStation(const ScriptAction& action, InstructorWindow& window, bool first);
  Result<bool> actOnAnalysis(const ScriptAction& action, InstructorWindow& window, bool first);
  Result<bool> actOnWindow(const ScriptAction& action, InstructorWindow& window, bool first);
  Result<bool> answered(LabState& lab) const;
  Result<bool> worked(LabState& lab) const;
  void fail(const ScriptAction& action, const std::string& why);

  std::vector<ScriptAction> actions_;
  std::string name_;
  std::function<void(const std::string&)> print_;
  std::size_t next_ = 0;
  bool begun_ = false, over_ = false;
  double began_s_ = 0, patience_s_ = 30;
  std::size_t frames_ = 0;       // since the action began
  std::size_t live_before_ = 0;  // live frames shown before the action
  std::size_t frame_count_ = 0;
  double frame_cost_s_ = 0, frame_most_s_ = 0;
  Status status_;
};

}  // namespace needlelab
