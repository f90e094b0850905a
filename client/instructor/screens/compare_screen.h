/// Two recordings beside each other, or laid over each other.
#pragma once

#include <optional>
#include <vector>

#include "client/instructor/model/desk.h"
#include "client/instructor/screens/gesture_pane.h"

namespace needlelab {

/// Thread: the surface's.
class CompareScreen {
 public:
  CompareScreen(ScenePane first, ScenePane second) : first_(std::move(first)), second_(std::move(second)) {}
  void show(Desk& desk);
  Alignment alignment = Alignment::kDepth;

 private:
  /// One series of both, as plots want it.
  struct Curves {
    std::vector<double> a, b, difference;
  };
  void takeIn(const GestureComparison& comparison);
  void showChoice(Desk& desk);
  void showScenes(Desk& desk, ImVec2 size_px);
  void showCurves(Desk& desk, ImVec2 size_px);
  [[nodiscard]] const ComparedPoint& pointAt(const GestureComparison& comparison) const;

  ScenePane first_, second_;
  const void* of_ = nullptr;  // whose curves these are
  std::size_t of_size_ = 0;
  std::vector<double> x_;
  std::vector<Curves> curves_;
  double at_ = 0;  // on the comparison's axis
  bool overlaid_ = true;
};

}  // namespace needlelab
