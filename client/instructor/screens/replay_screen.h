/// A recording, played again.
#pragma once

#include <string>

#include "client/instructor/model/desk.h"
#include "client/instructor/screens/gesture_pane.h"

namespace needlelab {

/// Thread: the surface's.
class ReplayScreen {
 public:
  explicit ReplayScreen(ScenePane pane) : pane_(std::move(pane)) {}
  void show(Desk& desk);
  ScenePane& pane() { return pane_; }
  PlotSet plots = PlotSet::kForces;
  void focusRemark() { focus_remark_ = true; }

 private:
  void showHead(Desk& desk);
  void showPlayer(Desk& desk);
  ScenePane pane_;
  std::string remark_;
  bool focus_remark_ = false;
  bool whole_ = true;  ///< plots: all of it, else 10 s about where it is
};

/// Play, step, speed, loop. Also under the comparison.
void playerButtons(ReplayPlayer& player);

}  // namespace needlelab
