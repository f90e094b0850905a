/// Speaking to the trainee who is looked over: message, remark, next exercise, aids, stop.
#pragma once

#include <string>

#include "client/instructor/model/desk.h"

namespace needlelab {

/// What is being typed. Thread: the surface's.
class TalkPanel {
 public:
  /// `desk.live()` is not null.
  void show(Desk& desk);
  /// The next frame puts the cursor there.
  void focusMessage() { focus_message_ = true; }
  void focusRemark() { focus_remark_ = true; }

 private:
  void showWords(Desk& desk);
  void showExercise(Desk& desk);
  void showAids(Desk& desk);
  void showStop(Desk& desk);
  std::string message_, remark_, reason_;
  bool focus_message_ = false, focus_remark_ = false, confirm_stop_ = false;
};

}  // namespace needlelab
