/// Makes the paths of a needle in a body beside the haptic thread (common/haptics/body/body_engine.h).
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

#include "common/base/wait_free.h"
#include "common/haptics/body/body_engine.h"

namespace needlelab {

/// How often the worker looks for a question. A path takes about 0.1 ms and is used 5 ms after it was asked
/// for.
inline constexpr std::chrono::milliseconds kPathPoll{1};

/// A thread that looks for questions and makes the paths; its priority belongs below the haptic loop's, above
/// ordinary work. `ask`, `take` and `retire` are for one thread, the haptic thread, and are wait-free. Must
/// outlive the engine that asks.
class PathWorker final : public PathMaker {
 public:
  /// `body` must outlive the worker. Starts the thread, which calls `at_start` first: it sets its priority.
  explicit PathWorker(const SceneModel& body, std::function<void()> at_start = {});
  ~PathWorker() override;
  PathWorker(const PathWorker&) = delete;
  PathWorker& operator=(const PathWorker&) = delete;

  void ask(const PathAsk& ask) noexcept override { asks_.push(ask); }
  bool take(PathStack*& made) noexcept override { return made_.pop(made); }
  void retire(PathStack* path) noexcept override { retired_.push(path); }

 private:
  void work();
  void takeRetired();

  const SceneModel& body_;
  // one question is open at a time; a path is retired when another is taken
  SpscRing<PathAsk, 2> asks_;
  SpscRing<PathStack*, 2> made_;
  SpscRing<PathStack*, 8> retired_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace needlelab
