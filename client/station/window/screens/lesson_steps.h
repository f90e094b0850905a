/// The aid STEPS: one sentence at a time that says what to do next, with its keys, in three steps.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/device/hand/hand_options.h"
#include "client/station/run/lesson_observer.h"
#include "client/station/window/screens/lesson_follow.h"
#include "client/station/window/screens/pointer_steering.h"
#include "common/scoring/anatomy/anatomy.h"

namespace needlelab {

/// What the steps judge by, in one frame.
struct StepFacts {
  bool capped = false;
  double above_skin_m = 0;  ///< of the cap's ball or the tip; negative: it presses, or is in tissue
  bool feels_bone = false;  ///< the cap's ball rests on the landmark
  double force_N = 0;
  /// From the needle's line to the landmark, across the needle: to the right and away, as the arrow keys go;
  /// none: nothing to feel for.
  std::optional<double> landmark_right_m = {}, landmark_away_m = {};
  bool inside = false;
  double off_line_m = 0, off_line_rad = 0;  ///< between needle and planned line
  double short_m = 0;                       ///< from the tip to its place in the target, along the needle
  bool in_target = false;                   ///< tip and opening, or the tip is at its place
  bool on_bone = false;                     ///< the needle
  double plunger = 0;                       ///< 0-1
};

struct LessonStep {
  int number = 1;  ///< 1-3
  std::string title, sentence;
  std::vector<std::string>
      keys;  ///< as on the keyboard, to be held or pressed together, or one after the other
};

/// Chooses the next sentence; remembers what was done. Pure logic. Thread: one.
class LessonSteps {
 public:
  /// `by_keys`: mouse and keys move the needle; otherwise the sentences speak of the handle. `injects`: the
  /// exercise asks for aspiration and injection. Empty names have general words.
  LessonSteps(bool by_keys, bool injects, std::string landmark, std::string target)
      : by_keys_(by_keys), injects_(injects), landmark_(std::move(landmark)), target_(std::move(target)) {}

  LessonStep next(const StepFacts& facts);

 private:
  LessonStep say(int number, const char* title, std::vector<std::string> keys, const std::string& by_keys,
                 const std::string& by_hand) const;
  LessonStep feel(const StepFacts& facts);
  LessonStep goIn(const StepFacts& facts);
  LessonStep inject(const StepFacts& facts);

  bool by_keys_, injects_;
  std::string landmark_, target_;
  bool over_landmark_ = false, felt_ = false, arrived_ = false, drew_back_ = false, goes_out_ = false,
       done_ = false;
};

/// The facts of a lesson's frame. `way`, `anatomy`: the lesson's.
StepFacts stepFactsOf(const LessonFollow& lesson, const LessonStatus& status, const PlannedInsertion& way,
                      const Anatomy& anatomy, const SteerView& view);

/// Draws a step across the panel: its keys, lit while they are down, and its sentence.
void stepStrip(const LessonStep& step);

}  // namespace needlelab
