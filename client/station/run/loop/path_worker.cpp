#include "client/station/run/loop/path_worker.h"

#include <memory>

namespace needlelab {

PathWorker::PathWorker(const SceneModel& body) : body_(body), thread_([this] { work(); }) {}

PathWorker::~PathWorker() {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
  takeRetired();
  for (PathStack* made = nullptr; made_.pop(made);) delete made;
}

PathWorker::Retired PathWorker::takeRetired() {
  Retired retired;
  for (PathStack* path = nullptr; retired_.pop(path);) retired.emplace_back(path);
  return retired;
}

void PathWorker::work() {
  PathAsk ask;
  while (!stop_.load(std::memory_order_relaxed)) {
    // taken before the question, deleted after its answer: one that was asked before a path was retired may
    // read that path
    const Retired retired = takeRetired();
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
