/// Paths in a body that come late.
#pragma once

#include <functional>
#include <utility>

#include "common/haptics/body/body_engine.h"

namespace needlelab::test {

/// Has each path only when it is asked for the given number of times more: `lateness` of the number of the
/// ask, from 0, and the ask.
class LatePaths final : public PathMaker {
 public:
  LatePaths(const SceneModel& body, std::function<int(int, const PathAsk&)> lateness)
      : in_place_(body), lateness_(std::move(lateness)) {}
  void ask(const PathAsk& ask) noexcept override {
    in_place_.ask(ask);
    left_ = lateness_(asks_++, ask);
  }
  bool take(PathStack*& made) noexcept override { return left_-- <= 0 && in_place_.take(made); }
  void retire(PathStack* path) noexcept override { in_place_.retire(path); }

 private:
  PathsInPlace in_place_;
  std::function<int(int, const PathAsk&)> lateness_;
  int asks_ = 0, left_ = 0;
};

}  // namespace needlelab::test
