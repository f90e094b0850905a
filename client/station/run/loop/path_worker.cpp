#include "client/station/run/loop/path_worker.h"

#include <memory>

#include "client/station/run/loop/real_time.h"

namespace needlelab {
namespace {

constexpr int kPriority = 20;  // SCHED_FIFO; the haptic loop has 80

}  // namespace

PathWorker::PathWorker(const SceneModel& body) : body_(body), thread_([this] { work(); }) {}

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
  // without permission it keeps its normal priority, which matters only on a busy machine
  static_cast<void>(makeThreadRealTime(kPriority));
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
