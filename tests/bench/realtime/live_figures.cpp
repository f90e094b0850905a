#include <fmt/core.h>

#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "tests/bench/realtime/figures.h"
#include "tests/netfaults/viewers.h"

namespace needlelab::test {

void addViewers(Figures& figures, double seconds) {
  const std::size_t crowd_size = seconds < 1 ? 6 : 100;
  RunningServer server([](ServerOptions& options) { withSlowViewers(options, std::chrono::hours(1)); });
  const Instructor instructor(server);
  std::vector<std::unique_ptr<Streamer>> stations;
  for (std::size_t i = 0; i < kStreamers; ++i)
    stations.push_back(std::make_unique<Streamer>(server, fmt::format("s{}", i), i));
  GoodViewer viewer(instructor.connect(false));
  const auto measure = [&](const std::string& beside) {
    // until the last change has settled
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    for (const auto& station : stations) station->take();
    viewer.take();
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    Delays acks;
    for (const auto& station : stations)
      for (const double ms : station->take().ms) acks.ms.push_back(ms);
    const Delays frames = viewer.take();
    const auto add = [&](const char* name, const Delays& delays) {
      figures.push_back({fmt::format("live: {}{} p50", name, beside), "ms", delays.at(0.5), Beside::kMedian});
      figures.push_back({fmt::format("live: {}{} p99", name, beside), "ms", delays.at(0.99), Beside::kP99});
    };
    add("chunk to acknowledgement", acks);
    add("capture to viewer", frames);
  };
  measure("");
  const Crowd crowd(server.server().port(), instructor, crowd_size);
  measure(" beside viewers that do not read");
}

}  // namespace needlelab::test
