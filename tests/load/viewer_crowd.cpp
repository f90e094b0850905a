#include "tests/load/viewer_crowd.h"

namespace needlelab::test {

ViewerCrowd::ViewerCrowd(LoadShared& shared, const pb::Login& login, std::size_t viewers) {
  for (std::size_t i = 0; i < viewers; ++i)
    viewers_.push_back(std::make_shared<LoadViewer>(shared, login, i, viewers, totals_, net_.io()));
}

ViewerCrowd::~ViewerCrowd() {
  stop();
}

void ViewerCrowd::connect() {
  for (const auto& viewer : viewers_) asio::co_spawn(net_.io(), LoadViewer::run(viewer), rethrow);
}

std::size_t ViewerCrowd::watching() {
  return net_.call([this] {
    std::size_t count = 0;
    for (const auto& viewer : viewers_) count += viewer->watching() ? 1 : 0;
    return count;
  });
}

std::string ViewerCrowd::lastError() {
  return net_.call([this] {
    std::string error;
    for (const auto& viewer : viewers_)
      if (!viewer->lastError().empty()) error = viewer->lastError();
    return error;
  });
}

void ViewerCrowd::pause(std::size_t viewer, std::chrono::milliseconds time) {
  net_.call([this, viewer, time] { viewers_[viewer]->pause(time); });
}

void ViewerCrowd::stop() {
  if (stopped_) return;
  stopped_ = true;
  net_.call([this] {
    for (const auto& viewer : viewers_) viewer->stop();
  });
  for (int i = 0; i < 3; ++i) net_.call([] {});
  net_.stop();
}

}  // namespace needlelab::test
