// Proves the guarantees of the haptic thread (ARCHITECTURE.md: no heap, no lock, no exception, no system
// calls except for the clock and the device) over a whole life of the loop: force, missed ticks, FAULT, black
// box, acknowledgement.
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <limits>
#include <memory>
#include <mutex>
#include <thread>

#include "client/device/factory/device_factory.h"
#include "client/station/run/loop/black_box.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/realtime/no_lock.h"
#include "tests/support/realtime/syscall_jail.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/station/run/loop/loop_fixture.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kLifeTicks = 1500;

// force from tick 300, then every kind of error, one after the other
DeviceRead troubledLife(std::uint64_t tick, DeviceReading& reading) {
  reading.condition = 0;
  if (tick < 300) return goingDown(0.02, kRate)(tick, reading);
  if (tick < 330) return DeviceRead::kNoUpdate;
  reading.X_WH = {{0, 0, 5e-3}, {1, 0, 0, 0}};
  if (tick >= 600 && tick < 680) reading.condition = kDeviceEmergencyStop;
  if (tick >= 900 && tick < 990) reading.X_WH.p.x = std::numeric_limits<double>::quiet_NaN();
  if (tick >= 1150 && tick < 1250) reading.condition = kDeviceReleased | kDeviceSaturated;
  return DeviceRead::kFresh;
}

/// A device that plays `troubledLife` without using the heap, and stalls the thread for 5 ms at tick 450. On
/// a slow machine nothing is skipped: each read is the next tick.
class TroubledDevice final : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double) override { return {}; }
  DeviceRead read(DeviceReading& reading) noexcept override {
    if (tick == 450) {
      const timespec stall{0, 5'000'000};
      ::clock_nanosleep(CLOCK_MONOTONIC, 0, &stall, nullptr);
    }
    if (tick == wrong_at) {
      wrong_at = ~0ull;
      wrongThing();
    }
    if (acknowledges != nullptr) acknowledges->acknowledge();
    // a busy machine may delay the acknowledging thread
    const bool waits = ends != nullptr && (tick == 550 || tick == 850 || tick == 1140 || tick == 1450) &&
                       ends->fault() != Fault::kNone;
    if (ends != nullptr && tick == kLifeTicks) ends->stop();
    return troubledLife(waits ? tick : tick++, reading);
  }
  void write(const GuardedWrench&) noexcept override {}
  std::uint64_t skip(std::uint64_t ticks) noexcept override { return ticks; }
  void close() noexcept override {}

  std::uint64_t tick = 0, wrong_at = ~0ull;
  void (*wrongThing)() = nullptr;
  ServoLoop* acknowledges = nullptr;  ///< in every tick: on virtual time other threads are too slow
  ServoLoop* ends = nullptr;          ///< ended after its last tick, which waits for acknowledgements

 private:
  DeviceInfo info_;
};

/// The threads beside the loop in a station: acknowledge every fault, empty the ring, read all states.
class Beside {
 public:
  Beside(ServoLoop& loop, SampleRing& ring) : thread_([this, &loop, &ring] { run(loop, ring); }) {}
  ~Beside() { finish(); }
  void finish() {
    done_.store(true);
    if (thread_.joinable()) thread_.join();
  }
  std::uint64_t samples = 0, seen = 0;
  std::atomic<bool> consistent{true};

 private:
  void run(ServoLoop& loop, SampleRing& ring) {
    for (bool last = false; !last;) {
      last = done_.load();
      GestureSample sample;
      while (ring.pop(sample)) ++samples;
      seen += loop.latest(sample);
      if (loop.fault() != Fault::kNone) loop.acknowledge();
      const LatencyQuantiles q = loop.stats().wakeup.quantiles();
      if (q.p50_ns > q.p99_ns || loop.faults() > 100 || (loop.condition() & ~kDeviceFlags) != 0)
        consistent.store(false);
      std::this_thread::sleep_for(1ms);
    }
  }
  std::atomic<bool> done_{false};
  std::thread thread_;
};

class LoopProof : public LoopFixture {
 protected:
  LoopProof() { model_ = *compile(allEffects(), kRate); }
  void prepare(Device& device, TimeSource& clock, std::uint64_t max_ticks = kLifeTicks) {
    box_ = std::make_unique<BlackBox>(kRate);
    ServoSettings settings{kRate, {}, max_ticks, FaultPolicy::kWait};
    settings.black_box = box_.get();
    settings.passivity.emplace();
    settings.starts_capped = model_.isLive(Effect::kPalpation);
    if (model_.body_spec) paths_ = std::make_unique<PathWorker>(model_);
    loop_ = std::make_unique<ServoLoop>(model_, device, clock, *ring_, settings, paths_.get());
  }
  void useBody() { model_ = *compile(sceneIn(arm()), kRate); }
  // the cap, a ball of 0.5 mm, begins 0.5 mm off the skin, then presses 5 mm deep
  void useCappedBody() {
    SceneSpec scene = sceneIn(arm());
    scene.effects |= bitOf(Effect::kPalpation);
    useUsualNumbers(effectEntry(Effect::kPalpation), scene);
    scene.stage_numbers[stageOf(Effect::kPalpation)][kPalpationRadius_m] = 0.5e-3;
    model_ = *compile(scene, kRate);
  }
  // Runs the loop to its end in this thread.
  void expectNoHeapOrLock() {
    std::uint64_t heap_calls = 1, lock_calls = 1;
    {
      const NoAllocScope no_heap;
      const NoLockScope no_lock;
      loop_->run();
      lock_calls = no_lock.calls();
      heap_calls = no_heap.calls();
    }
    EXPECT_EQ(heap_calls, 0u);
    if (NoLockScope::works()) {
      EXPECT_EQ(lock_calls, 0u);
    }
  }
  // The loop passed through every state, so the proof covers all of them.
  void expectWholeLife(ServoEnd end) {
    const ServoStats& stats = loop_->stats();
    EXPECT_EQ(stats.end, end);
    EXPECT_GE(stats.faults, 3u);
    EXPECT_EQ(stats.fault, Fault::kNone) << "each was acknowledged";
    EXPECT_GE(stats.missed_ticks, 4u);
    EXPECT_GE(stats.flag_ticks[23], 1u) << "the hold was there";
  }
  TempFolder folder_;
  std::unique_ptr<BlackBox> box_;
};

TEST_F(LoopProof, noHeapAndNoLockInAWholeLife) {
  TroubledDevice device;
  clock_.late_ns[700] = 5 * kTick_ns;
  prepare(device, clock_);
  device.acknowledges = loop_.get();
  expectNoHeapOrLock();
  expectWholeLife(ServoEnd::kTicksDone);
  EXPECT_EQ(loop_->stats().faults, 3u);
  EXPECT_EQ(box_->triggers(), 3u);
}

TEST_F(LoopProof, underLoadItKeepsItsGuaranteesAndLosesNothing) {
  TroubledDevice device;
  LoopTime clock;
  prepare(device, clock, 0);
  device.ends = loop_.get();
  std::vector<std::string> said;
  BlackBoxWriter writer(*box_, folder_.path(), "life",
                        [&](const std::string& text) { said.push_back(text); });
  Beside beside(*loop_, *ring_);
  std::thread haptic([&] { expectNoHeapOrLock(); });
  while (!loop_->ended()) std::this_thread::sleep_for(1ms);
  haptic.join();
  beside.finish();
  writer.finish();
  expectWholeLife(ServoEnd::kStopped);
  EXPECT_TRUE(beside.consistent.load());
  EXPECT_EQ(beside.samples + ring_->dropped(), loop_->stats().samples);
  EXPECT_GT(beside.seen, 10u);
  const BlackBoxCounts counts = writer.counts();
  EXPECT_GE(counts.files, 1u);
  EXPECT_EQ(counts.files, said.size());
  EXPECT_EQ(counts.not_kept + counts.not_written + counts.ticks_refused, 0u);
}

TEST_F(LoopProof, inABodyTheThreadBesideItMakesThePaths) {
  useBody();
  TroubledDevice device;
  LoopTime clock;
  prepare(device, clock, 0);
  device.ends = loop_.get();
  Beside beside(*loop_, *ring_);
  std::thread haptic([&] { expectNoHeapOrLock(); });
  haptic.join();
  beside.finish();
  expectWholeLife(ServoEnd::kStopped);
  EXPECT_GE(loop_->stats().flag_ticks[12], 1u) << "new paths";
}

TEST_F(LoopProof, withTheCapOnItTakesPiecesOfTheBodyWithoutHeapOrLock) {
  useCappedBody();
  TroubledDevice device;
  LoopTime clock;
  prepare(device, clock, 0);
  device.ends = loop_.get();
  Beside beside(*loop_, *ring_);
  std::thread haptic([&] { expectNoHeapOrLock(); });
  haptic.join();
  beside.finish();
  expectWholeLife(ServoEnd::kStopped);
  EXPECT_GE(loop_->stats().flag_ticks[14], 1000u) << "capped";
  EXPECT_EQ(loop_->stats().flag_ticks[0], 0u) << "it enters nothing";
  EXPECT_EQ(loop_->stats().flag_ticks[9], 0u) << "it feels from the first touch on";
}

TEST_F(LoopProof, theLockWatcherWouldSeeALock) {
  if (!NoLockScope::works()) GTEST_SKIP() << "a sanitizer has its own locks";
  std::mutex mutex;
  const NoLockScope guard;
  { const std::scoped_lock lock(mutex); }
  EXPECT_EQ(guard.calls(), 1u);
}

class LoopJail : public LoopProof {
 protected:
  // The loop runs in a jail that allows only the clock's system calls, with the other threads of a station
  // beside it.
  JailOutcome live(Device& device) {
    return runInJail(
        {SYS_clock_gettime, SYS_clock_nanosleep},
        [&] {
          prepare(device, clock_jailed_, troubled_ ? 0 : kLifeTicks);
          if (troubled_) static_cast<TroubledDevice&>(device).ends = loop_.get();
          writer_ =
              std::make_unique<BlackBoxWriter>(*box_, folder_.path(), "jail", [](const std::string&) {});
          beside_ = std::make_unique<Beside>(*loop_, *ring_);
        },
        [&] { loop_->run(); },
        [&] {
          beside_->finish();
          writer_->finish();
          const ServoStats& stats = loop_->stats();
          if (model_.body_spec && stats.flag_ticks[12] == 0) return 6;  // no new path
          if (stats.end != (troubled_ ? ServoEnd::kStopped : ServoEnd::kTicksDone)) return 1;
          if (!troubled_) return stats.faults == 0 ? 0 : 2;
          if (stats.faults < 3 || stats.fault != Fault::kNone) return 3;
          if (stats.missed_ticks < 4) return 4;
          return writer_->counts().files >= 1 ? 0 : 5;
        });
  }
  bool troubled_ = true;
  LoopTime clock_jailed_{100'000};  // also without sleeping in the spin
  std::unique_ptr<BlackBoxWriter> writer_;
  std::unique_ptr<Beside> beside_;
};

TEST_F(LoopJail, aWholeLifeNeedsNoSystemCallButTheClocks) {
  TroubledDevice device;
  const JailOutcome outcome = live(device);
  if (!outcome.supported) GTEST_SKIP() << "no filter of system calls here";
  EXPECT_EQ(outcome.forbidden_call, -1);
  ASSERT_TRUE(outcome.finished);
  EXPECT_EQ(outcome.result, 0);
}

TEST_F(LoopJail, inABodyItNeedsNoneEither) {
  useBody();
  TroubledDevice device;
  const JailOutcome outcome = live(device);
  if (!outcome.supported) GTEST_SKIP() << "no filter of system calls here";
  EXPECT_EQ(outcome.forbidden_call, -1);
  ASSERT_TRUE(outcome.finished);
  EXPECT_EQ(outcome.result, 0);
}

TEST_F(LoopJail, withTheCapOnItNeedsNoneEither) {
  useCappedBody();
  TroubledDevice device;
  const JailOutcome outcome = live(device);
  if (!outcome.supported) GTEST_SKIP() << "no filter of system calls here";
  EXPECT_EQ(outcome.forbidden_call, -1);
  ASSERT_TRUE(outcome.finished);
  EXPECT_EQ(outcome.result, 0);
}

TEST_F(LoopJail, theSimulatedDeviceNeedsNoneEither) {
  troubled_ = false;
  DeviceOptions options;
  options.scene = allEffects();
  auto device = makeDevice("simulated", options);
  ASSERT_TRUE(device.ok()) << device.error().message;
  ASSERT_TRUE((*device)->open(kRate).ok());
  const JailOutcome outcome = live(**device);
  if (!outcome.supported) GTEST_SKIP() << "no filter of system calls here";
  EXPECT_EQ(outcome.forbidden_call, -1);
  ASSERT_TRUE(outcome.finished);
  EXPECT_EQ(outcome.result, 0);
}

TEST_F(LoopJail, aForbiddenCallIsSeen) {
  TroubledDevice device;
  device.wrong_at = 100;
  device.wrongThing = [] { ::syscall(SYS_getppid); };
  const JailOutcome outcome = live(device);
  if (!outcome.supported) GTEST_SKIP() << "no filter of system calls here";
  EXPECT_FALSE(outcome.finished);
  EXPECT_EQ(outcome.forbidden_call, SYS_getppid);
}

// No exception leaves a tick or any function that a tick calls: checked at compile time.
static_assert(noexcept(std::declval<ServoLoop&>().run()));
static_assert(noexcept(std::declval<Device&>().read(std::declval<DeviceReading&>())) && noexcept(
    std::declval<Device&>().write(GuardedWrench{})) && noexcept(std::declval<Device&>().skip(1)));
static_assert(noexcept(std::declval<HapticChain&>().tick(
    DeviceReading{}, true, 1, 1.0,
    std::declval<ChainTick&>())) && noexcept(std::declval<HapticChain&>()
                                                 .acknowledge()) && noexcept(std::declval<HapticChain&>()
                                                                                 .raiseFromOutside(
                                                                                     Fault::kNone)));
static_assert(
    noexcept(std::declval<BlackBox&>().next()) && noexcept(std::declval<BlackBox&>().commit()) && noexcept(
        std::declval<BlackBox&>().trigger(
            BlackBoxCause::kFault, Fault::kNone,
            0)) && noexcept(std::declval<BlackBox&>().finish()) && noexcept(std::declval<MissedTickStorm&>()
                                                                                .note(1)));
static_assert(noexcept(std::declval<LatencyHistogram&>().add(1)) && noexcept(std::declval<SampleRing&>().push(
    GestureSample{})) && noexcept(std::declval<LatestValue<GestureSample>&>().publish(GestureSample{})));
static_assert(
    noexcept(std::declval<TimeSource&>().nowNs()) && noexcept(std::declval<TimeSource&>().sleepUntilNs(0)));

}  // namespace
}  // namespace needlelab::test
