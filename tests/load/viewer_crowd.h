/// All viewers of a run on one network thread.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tests/load/load_viewer.h"
#include "tests/load/net_thread.h"

namespace needlelab::test {

/// Thread: the owner's; its own for the network.
class ViewerCrowd {
 public:
  ViewerCrowd(LoadShared& shared, const pb::Login& login, std::size_t viewers);
  ~ViewerCrowd();

  void connect();
  /// How many watch all of their stations.
  [[nodiscard]] std::size_t watching();
  [[nodiscard]] std::string lastError();
  void pause(std::size_t viewer, std::chrono::milliseconds time);
  /// After the end.
  [[nodiscard]] const ViewerTotals& totals() const { return totals_; }
  void stop();

 private:
  NetThread net_;  // destroyed last: viewers have timers on it; stop() has ended its thread before
  ViewerTotals totals_;
  bool stopped_ = false;
  std::vector<std::shared_ptr<LoadViewer>> viewers_;
};

}  // namespace needlelab::test
