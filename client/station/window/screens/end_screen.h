/// The window after a lesson: verdict, reasons, where the needle was, and the choices for the next one.
#pragma once

#include <imgui/imgui.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/station/run/lesson/local_score.h"
#include "client/station/run/lesson_observer.h"
#include "client/station/window/lessons/lesson_board.h"
#include "client/station/window/screens/insertion_replay.h"
#include "client/station/window/screens/lesson_follow.h"
#include "client/view/model/plot.h"
#include "client/view/model/scene_view.h"
#include "client/view/scene/scene_renderer.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/targets/miss.h"

namespace needlelab {

struct VerdictRow {
  std::string words;           ///< the measure and its requirement as a sentence
  std::optional<bool> passed;  ///< none: no requirement
};

struct LessonVerdict {
  enum class Kind : std::uint8_t { kPassed, kNotPassed, kNoRequirements, kNoScore };
  Kind kind = Kind::kNoScore;
  std::string title;                 ///< "Passed", "Not passed: 2 of 8 requirements are not met"; resultsText
  std::vector<VerdictRow> required;  ///< unmet requirements come first
  std::vector<VerdictRow> others;    ///< all other measures
  std::string ended;                 ///< how the lesson ended: "time is over", "stopped by ines: wrong side"
  std::string kept;                  ///< where the recording is, or what is wrong with it, as a sentence
  bool kept_well = true;             ///< false: part of it is lost or refused
  std::string waits;                 ///< why it does not count yet; empty: it counts
  std::string lowered;               ///< stiffnessShareText
  std::string by;                    ///< "scored by the server"; empty without a score
};

/// Pure.
LessonVerdict verdictOf(const LessonOutcome& outcome);

/// The plot's range: from outside the skin to the deepest point and target, up to the greatest force.
struct DepthPlotRange {
  double from_m = -0.01, to_m = 0.01;
  double force_N = 1;
};
DepthPlotRange depthPlotRange(const GestureCurve& curve, const TissuesOnLine& way);
/// Whether the point's tissue is not what the way has there: it was on another line.
bool isOffWay(const CurvePoint& point, const TissuesOnLine& way);
/// What lies on the line of the deepest insertion; where there is none, on the way to the target.
TissuesOnLine wayOf(const LessonOutcome& outcome, const SceneView& scene);

/// The tip's distance from its own line over time, and from the planned one, with the exercise's limits;
/// refers to the spans. `planned_mm`: empty without a plan. `measures`: of the score.
Plot lateralPlot(std::span<const double> time_s, std::span<const double> lateral_mm,
                 std::span<const double> planned_mm, std::span<const Measure> measures);

/// A moment of the gesture, marked in a plot.
struct MarkedMoment {
  double time_s = 0, insertion_m = 0, force_N = 0;
};
/// Draws force over depth along the needle: insertion and withdrawal in different colours, what was on
/// another line in grey; the way's tissues and targets as named bands; `marked` as a line and a dot.
void depthPlot(const GestureCurve& curve, const TissuesOnLine& way, const SceneView& scene, ImVec2 size_px,
               const std::optional<MarkedMoment>& marked = {});

/// Thread: the window's.
class EndScreen {
 public:
  /// `renderer` must outlive it.
  explicit EndScreen(SceneRenderer& renderer) : renderer_(renderer) {}
  /// Draws one frame. `changed`: `state` is newer than in the last call. `lesson`: the lesson that ended; may
  /// be null. `keys`: whether this screen gets the keys. Returns whether the person wants to quit.
  bool show(const BoardState& state, bool changed, const LessonFollow* lesson, bool keys, bool may_quit,
            LessonBoard& board);
  /// The insertion that is shown; none before a verdict, without an insertion, and for an exam whose results
  /// are not released.
  [[nodiscard]] const std::optional<InsertionReplay>& replay() const { return replay_; }
  /// Returns whether keys count yet: only a moment after the outcome came.
  [[nodiscard]] bool acceptsKeys() const;

 private:
  void take(const LessonOutcome& outcome);
  void takeReplay(const LessonFollow& lesson);
  void showVerdict(const std::string& what);
  void showMiss(const Miss& miss);
  void showDistance();
  void showGesture(const LessonOutcome& outcome, const LessonFollow* lesson);
  bool showNext(const BoardState& state, bool keys, bool may_quit, LessonBoard& board);

  SceneRenderer& renderer_;
  SceneFrame frame_;
  std::optional<InsertionReplay> replay_;
  std::uint64_t replay_lesson_ = 0;  // of replay_, and the last time of its samples
  double replay_until_s_ = -1;
  std::shared_ptr<const LessonOutcome> shown_;
  std::string session_;            // session of shown_
  double keys_from_s_ = 0;         // earlier keys were meant for the lesson
  bool characters_typed_ = false;  // since then; by a badge reader, because nothing is typed here
  LessonVerdict verdict_;
  std::vector<double> time_s_, lateral_mm_, planned_mm_;
  std::vector<Measure> measures_;
};

}  // namespace needlelab
