/// A haptic loop on the paper's one-dimensional scene, virtual time and a scripted device.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "client/station/run/loop/servo_loop.h"
#include "common/haptics/worker/path_worker.h"
#include "tests/support/scenes/scenes.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab::test {

inline constexpr double kRate = 1000;
inline constexpr std::int64_t kTick_ns = 1'000'000;

class LoopFixture : public testing::Test {
 protected:
  LoopFixture() : model_(*compile(paperOneDof(), kRate)) {}
  void make(FakeDevice& device, const ServoSettings& settings) {
    loop_ = std::make_unique<ServoLoop>(model_, device, clock_, *ring_, settings);
  }
  // runs the loop to its end and empties the ring
  const ServoStats& run(FakeDevice& device, const ServoSettings& settings) {
    make(device, settings);
    loop_->run();
    GestureSample sample;
    while (ring_->pop(sample)) samples_.push_back(sample);
    return loop_->stats();
  }
  SceneModel model_;
  FakeTime clock_;
  std::unique_ptr<SampleRing> ring_ = std::make_unique<SampleRing>();
  std::unique_ptr<PathWorker> paths_;  // of a body; outlives the loop
  std::unique_ptr<ServoLoop> loop_;
  std::vector<GestureSample> samples_;
};

}  // namespace needlelab::test
