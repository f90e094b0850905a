/// What the machine itself does to the haptic thread's time: looked at, and put right where the program may.
#pragma once

#include <filesystem>
#include <vector>

#include "client/station/run/rt_thread.h"

namespace needlelab {

/// While it lives the cores do not fall into deep sleep, from which they wake late: it holds
/// /dev/cpu_dma_latency at 0, as cyclictest does. The system forgets it when the program ends, however.
/// Thread: one.
class ShallowSleep {
 public:
  explicit ShallowSleep(const std::filesystem::path& file = "/dev/cpu_dma_latency");
  ~ShallowSleep();
  ShallowSleep(const ShallowSleep&) = delete;
  ShallowSleep& operator=(const ShallowSleep&) = delete;
  [[nodiscard]] const RtStep& step() const { return step_; }

 private:
  int file_ = -1;
  RtStep step_;
};

/// Looks at the limit for real-time threads and at the cores' clock (governor). Only what can be told: a
/// machine that offers no such setting gives no step. `root` is for tests.
std::vector<RtStep> judgeMachine(const RtOptions& options, const std::filesystem::path& root = "/");

}  // namespace needlelab
