/// The screens of the instructor's window and the frame around them. Each is a function of the lab's state;
/// the window calls it in every frame. Thread: the surface's.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/instructor/model/lab_state.h"
#include "client/instructor/screens/gesture_pane.h"
#include "client/view/action_bar.h"

namespace needlelab {

// --- around every screen: screen_frame.cpp

/// Draws the bar at the top. Empty screens can be selected too; they show advice.
void showNavigation(LabState& lab, bool& show_help);
/// Draws a banner below the bar while the connection is lost or refused: cause, advice, time of the next
/// attempt.
void showLinkBanner(LabState& lab);
/// Draws the notices over everything else at the lower edge.
void showNotices(LabState& lab);
/// Explains in the middle of an empty screen what is missing and how to get it. `action`: a button's label,
/// or null. Returns true if the button was pressed.
bool showEmpty(std::string_view headline, std::string_view advice, const char* action = nullptr);
/// Returns the action whose key was pressed; none during text input or keyboard navigation.
std::optional<int> pressedAction(std::span<const ScreenAction> actions);
/// Shows the running job with a progress bar; draws nothing without a job.
void showWork(const LabState& lab);

// --- the screens

/// The first screen: server, CA file, name, password. Explains errors in plain words.
void showLogin(LabState& lab);

/// Commands to one station or several: message, next exercise, aids, stop; to the watched one also a remark.
class CommandPanel {
 public:
  static float height_px();
  /// `to`: lab.commanded(), not empty.
  void show(LabState& lab, const std::vector<Addressee>& to);
  /// Moves the cursor there in the next frame.
  void focusMessage() { focus_message_ = true; }
  void focusRemark() { focus_remark_ = true; }

 private:
  void showTexts(LabState& lab, const std::vector<Addressee>& to);
  void showExercise(LabState& lab, const std::vector<Addressee>& to);
  void showAids(LabState& lab);
  void showStop(LabState& lab, const std::vector<Addressee>& lessons);
  std::string message_, remark_;  // as typed
  bool focus_message_ = false, focus_remark_ = false;
  AnswerGate stop_gate_;
};

/// The whole lab: a tile for each station, in the order of their names, a rail of those that need help, and
/// commands to those that are chosen.
class LabScreen {
 public:
  void show(LabState& lab);
  CommandPanel commands;

 private:
  static void showTiles(LabState& lab, ImVec2 size_px);
};

/// Live view of one trainee: scene, plots, commands to the station.
class LiveScreen {
 public:
  explicit LiveScreen(ScenePane pane) : pane_(std::move(pane)) {}
  void show(LabState& lab);
  CommandPanel commands;
  ScenePane& pane() { return pane_; }
  PlotSet plots = PlotSet::kForces;

 private:
  void showHead(LabState& lab);
  void showAlarms(LabState& lab);
  void showScene(LabState& lab, ImVec2 size_px);
  void showPlots(LiveStation& live, std::span<const PlotRequirement> requirements, ImVec2 size_px);
  ScenePane pane_;
  bool as_trainee_ = true;
};

/// The stored sessions: search, choose, load.
class SessionsScreen {
 public:
  void show(LabState& lab);
  SessionQuery query;  ///< as typed

 private:
  void showFilter(LabState& lab);
  void showTable(LabState& lab);
};

/// Replays a recording.
class ReplayScreen {
 public:
  explicit ReplayScreen(ScenePane pane) : pane_(std::move(pane)) {}
  void show(LabState& lab);
  ScenePane& pane() { return pane_; }
  PlotSet plots = PlotSet::kForces;
  void focusRemark() { focus_remark_ = true; }

 private:
  void showHead(LabState& lab);
  void showPlayer(LabState& lab);
  ScenePane pane_;
  std::string remark_;
  bool focus_remark_ = false;
  bool whole_ = true;  ///< plots show the whole gesture, otherwise 10 s around the current moment
};

/// Two recordings side by side or overlaid.
class CompareScreen {
 public:
  CompareScreen(ScenePane first, ScenePane second) : first_(std::move(first)), second_(std::move(second)) {}
  void show(LabState& lab);
  Alignment alignment = Alignment::kDepth;

 private:
  /// One series of both recordings, in the plots' format.
  struct Curves {
    std::vector<double> a, b, difference;
  };
  void updateCurves(const LabState& lab);
  void showChoice(LabState& lab);
  void showScenes(LabState& lab, ImVec2 size_px);
  void showCurves(LabState& lab, ImVec2 size_px);
  [[nodiscard]] const ComparedPoint& pointAt(const GestureComparison& comparison) const;

  ScenePane first_, second_;
  // What the curves show. Not an address, which another comparison may get later.
  std::weak_ptr<const StoredGesture> of_first_, of_second_;
  std::optional<Alignment> of_alignment_;
  std::vector<double> x_;
  std::vector<ComparedSeries> plotted_;
  std::vector<Curves> curves_;  // of plotted_
  double at_ = 0;               // position on the comparison's axis
  bool overlaid_ = true;
};

/// "What would it have felt like": runs the engine on the recording with another profile or model.
class RerunScreen {
 public:
  void show(LabState& lab);
  std::string profile = "own", model;  ///< the choice; an empty model: the profile's

 private:
  void showChoice(LabState& lab);
  void showForces(LabState& lab);
};

/// Measures compared with requirements and experts, the trainee's progress, export.
class ScoresScreen {
 public:
  void show(LabState& lab);

 private:
  void showMeasures(const ReportData& data);
  void showProgress(const ReportData& data);
  void showExport(LabState& lab);
  std::string file_ = "report.html";
  const void* asked_for_ = nullptr;  // gesture whose score was requested
};

}  // namespace needlelab
