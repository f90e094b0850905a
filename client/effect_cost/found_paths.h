/// The paths of a gesture in a body, found before it is measured: finding them is another thread's work.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "common/haptics/body/body_engine.h"

namespace needlelab {

/// In the first gesture it makes the paths in place and keeps copies; after each `rewind` it hands these out
/// in the same order. The engine that used the last ones must be gone by then. Thread: one.
class FoundPaths final : public PathMaker {
 public:
  /// `body` must outlive it.
  explicit FoundPaths(const SceneModel& body) : in_place_(body) {}

  void rewind() {
    replays_ = true;
    next_ = 0;
    given_.clear();
    for (const auto& path : found_) given_.push_back(path ? std::make_unique<PathStack>(*path) : nullptr);
  }
  void ask(const PathAsk& ask) noexcept override {
    if (!replays_) in_place_.ask(ask);
  }
  bool take(PathStack*& made) noexcept override {
    if (replays_) {
      made = next_ < given_.size() ? given_[next_++].get() : nullptr;
      return true;
    }
    const bool answers = in_place_.take(made);
    found_.push_back(made != nullptr ? std::make_unique<PathStack>(*made) : nullptr);
    return answers;
  }
  void retire(PathStack* path) noexcept override {
    if (!replays_) in_place_.retire(path);
  }

 private:
  PathsInPlace in_place_;
  bool replays_ = false;
  std::vector<std::unique_ptr<PathStack>> found_, given_;
  std::size_t next_ = 0;
};

}  // namespace needlelab
