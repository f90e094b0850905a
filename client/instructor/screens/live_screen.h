/// Over one trainee's shoulder: scene, plots, talk.
#pragma once

#include "client/instructor/model/desk.h"
#include "client/instructor/screens/gesture_pane.h"
#include "client/instructor/screens/talk_panel.h"

namespace needlelab {

/// Thread: the surface's.
class LiveScreen {
 public:
  explicit LiveScreen(ScenePane pane) : pane_(std::move(pane)) {}
  void show(Desk& desk);
  TalkPanel talk;
  ScenePane& pane() { return pane_; }
  PlotSet plots = PlotSet::kForces;

 private:
  void showHead(Desk& desk);
  void showScene(LiveStation& live, const AidSet& allowed, ImVec2 size_px);
  void showPlots(LiveStation& live, ImVec2 size_px);
  ScenePane pane_;
  bool as_trainee_ = true;
};

}  // namespace needlelab
