/// Whether the plunger is moving now, from the samples of a session as they come.
#pragma once

#include <deque>
#include <string>

#include "common/gesture/sample.h"

namespace needlelab {

/// Remembers a fifth of a second. Thread: one.
class PlungerWatch {
 public:
  /// The next sample of the session; one that is older than the last, or much later, begins anew.
  void add(const GestureSample& sample);
  /// "injecting", "aspirating", or empty (syringeAction in update.h), over the last 0.2 s or what there is of
  /// it.
  [[nodiscard]] std::string action() const;

 private:
  std::deque<GestureSample> kept_;  // at least 10 ms apart
  GestureSample newest_;
};

}  // namespace needlelab
