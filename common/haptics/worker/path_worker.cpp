#include "common/haptics/worker/path_worker.h"

#include <memory>
#include <utility>

namespace needlelab {

PathWorker::PathWorker(const SceneModel& body, std::function<void()> at_start)
    : body_(body), thread_([this, begin = std::move(at_start)] {
        if (begin) begin();
        work();
      }) {}

PathWorker::~PathWorker() {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
  takeRetired();
  for (PathStack* made = nullptr; made_.pop(made);) delete made;
}

void PathWorker::takeRetired() {
  for (PathStack* path = nullptr; retired_.pop(path);) delete path;
}

void PathWorker::work() {
  PathAsk ask;
  while (!stop_.load(std::memory_order_relaxed)) {
    takeRetired();
    if (!asks_.pop(ask)) {
      std::this_thread::sleep_for(kPathPoll);
      continue;
    }
    PathLayers path;
    std::unique_ptr<PathStack> made = findPath(body_, ask, path) ? compilePath(body_, path) : nullptr;
    if (made_.push(made.get())) static_cast<void>(made.release());
  }
}

}  // namespace needlelab
