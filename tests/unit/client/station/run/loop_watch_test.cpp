// The lesson's thread beside the real loop in a simulated world. The first tick is due after 2 ms, then one
// per ms; polls come every 50 ms, before a tick of the same time.
#include "client/station/run/loop_watch.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "common/base/text/uuid.h"
#include "common/haptics/effects/effect_entry.h"
#include "tests/support/blocked_signals.h"
#include "tests/support/scenes/scenes.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/device_world.h"
#include "tests/unit/client/net/spool/spool_samples.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab::test {
namespace {

using testing::ElementsAre;

constexpr double kWatchRate_hz = 1000;

/// Stores what the window would be told.
class KeptStatus final : public LessonObserver {
 public:
  explicit KeptStatus(DeviceWorld& world) : world_(world), begun_ns_(world.nowNs()) {}
  void status(const LessonStatus& status) override {
    at_ms.push_back((world_.nowNs() - begun_ns_) / kMs);
    statuses.push_back(status);
  }
  void aids(const ChosenAids& chosen) override { chosen_by.push_back(chosen.by); }

  std::vector<std::int64_t> at_ms;
  std::vector<LessonStatus> statuses;
  std::vector<std::string> chosen_by;

 private:
  DeviceWorld& world_;
  const std::int64_t begun_ns_;
};

class LoopWatchTest : public testing::Test {
 protected:
  LoopWatchTest() {
    EXPECT_EQ(::pipe(keyboard_.data()), 0);
    sigemptyset(&stop_signals_);
    sigaddset(&stop_signals_, SIGTERM);
    options_.headless = true;
    options_.rate_hz = kWatchRate_hz;
    options_.spool = folder_.path();
    EXPECT_TRUE(home_.openSpool().ok());
    EXPECT_TRUE(home_.connect().ok());
    writer_ = std::make_unique<SpoolWriter>(*ring_, *home_.spool().create(describeSession(makeUuidV7())),
                                            SpoolWriterOptions{.time = &world_, .threads = false},
                                            SpoolWriter::Callbacks{});
  }
  ~LoopWatchTest() override {
    for (const int end : keyboard_) ::close(end);
  }

  void at(std::int64_t ms, std::function<void()> happens) {
    world_.at(world_.nowNs() + ms * kMs, std::move(happens));
  }
  void pressEnter() { ASSERT_EQ(::write(keyboard_[1], "\n", 1), 1); }

  // Runs the loop to its end and watches it.
  const ServoStats& run(FakeDevice& device, const ServoSettings& settings) {
    loop_ = std::make_unique<ServoLoop>(model_, device, world_, *ring_, settings);
    const DeviceMaintenance maintenance(device, world_, world_);
    EnterKey enter(keyboard_[0]);
    watch_ = std::make_unique<LoopWatch>(
        WatchedLesson{home_, options_, lesson_, *loop_, *writer_, maintenance, settings.on_fault, alarms_},
        stop_signals_, enter);
    auto running = world_.start(*watch_, {"lessons", 0});
    loop_->run();
    running.reset();  // its last poll
    return loop_->stats();
  }
  [[nodiscard]] std::vector<std::int64_t> multiplesOf50(std::int64_t last) const {
    std::vector<std::int64_t> all;
    for (std::int64_t ms = 50; ms <= last; ms += 50) all.push_back(ms);
    return all;
  }

  // The device is silent from tick 100 (101 ms after the beginning: its first silent tick would be at 102 ms)
  // to tick 200, then outside the tissue. The gate's FAULT comes in the 21st silent tick, at 122 ms.
  const ServoStats& runSilent() {
    FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
      if (tick < 100) return goingDown(0.02, kWatchRate_hz)(tick, reading);
      if (tick < 200) return DeviceRead::kNoUpdate;
      reading.X_WH = {{0, 0, 5e-3}, {1, 0, 0, 0}};
      return DeviceRead::kFresh;
    });
    return run(device, {kWatchRate_hz, {}, 400, FaultPolicy::kWait});
  }
  [[nodiscard]] std::vector<Fault> faults() const {
    std::vector<Fault> all;
    for (const LessonStatus& status : observer_.statuses) all.push_back(status.fault);
    return all;
  }

  AudibleTone tone_;
  LessonAlarms alarms_{tone_, ToneChoice::kOff};
  TempFolder folder_;
  const BlockedSignals blocked_{SIGTERM, SIGUSR1};
  std::array<int, 2> keyboard_{-1, -1};
  DeviceWorld world_;
  KeptStatus observer_{world_};
  StationOptions options_;
  StationHome home_{options_, observer_, world_};
  sigset_t stop_signals_{};
  StationLesson lesson_;
  SceneModel model_ = *compile(paperOneDof(), kWatchRate_hz);
  std::unique_ptr<SampleRing> ring_ = std::make_unique<SampleRing>();
  std::unique_ptr<SpoolWriter> writer_;
  std::unique_ptr<ServoLoop> loop_;
  std::unique_ptr<LoopWatch> watch_;
};

TEST_F(LoopWatchTest, looksTwentyTimesASecondAndOnceWhenTheLoopHasEnded) {
  FakeDevice device(goingDown(0.02, kWatchRate_hz));
  // the last tick comes at 1,001 ms
  const ServoStats& stats = run(device, {kWatchRate_hz, {}, 1000});
  EXPECT_EQ(stats.end, ServoEnd::kTicksDone);
  EXPECT_EQ(observer_.at_ms, multiplesOf50(1050));
  EXPECT_FALSE(watch_->interrupted());
  EXPECT_FALSE(watch_->stopped());
  for (std::size_t i = 0; i + 1 < observer_.statuses.size(); ++i) {
    // before the tick of the same time: the newest sample is from the previous ms
    EXPECT_DOUBLE_EQ(observer_.statuses[i].time_s, 1e-3 * static_cast<double>(observer_.at_ms[i] - 3));
    EXPECT_EQ(observer_.statuses[i].missed_ticks, 0u);
    EXPECT_FALSE(observer_.statuses[i].waits);
  }
  EXPECT_DOUBLE_EQ(observer_.statuses.back().time_s, 0.999);
}

TEST_F(LoopWatchTest, aStopSignalEndsLoopAndProgramAtTheNextCheck) {
  FakeDevice device(goingDown(0.02, kWatchRate_hz));
  at(220, [] { ::raise(SIGTERM); });
  const ServoStats& stats = run(device, {kWatchRate_hz, {}, 0});
  EXPECT_TRUE(watch_->interrupted());
  EXPECT_FALSE(watch_->stopped());
  EXPECT_EQ(stats.end, ServoEnd::kStopped);
  // stopped at 250 ms, before tick 248; the force fades out in 20 ticks
  EXPECT_EQ(stats.ticks, 268u);
  EXPECT_EQ(observer_.at_ms, multiplesOf50(300));
}

TEST_F(LoopWatchTest, aSignalFromBeforeTheLessonCountsAtTheFirstLook) {
  FakeDevice device(goingDown(0.02, kWatchRate_hz));
  ::raise(SIGTERM);
  const ServoStats& stats = run(device, {kWatchRate_hz, {}, 0});
  EXPECT_TRUE(watch_->interrupted());
  EXPECT_EQ(stats.ticks, 68u) << "stopped at 50 ms, before tick 48";
  EXPECT_EQ(observer_.at_ms, multiplesOf50(100));
}

TEST_F(LoopWatchTest, theFirstRequestToStopCountsAndEndsTheLessonOnly) {
  FakeDevice device(goingDown(0.02, kWatchRate_hz));
  at(70, [this] { home_.requests().stop({"ines", "wrong side"}); });
  at(110, [this] { home_.requests().stop({"", "changed my mind"}); });
  const ServoStats& stats = run(device, {kWatchRate_hz, {}, 0});
  EXPECT_FALSE(watch_->interrupted());
  ASSERT_TRUE(watch_->stopped());
  EXPECT_EQ(watch_->stopped()->by, "ines");
  EXPECT_EQ(watch_->stopped()->reason, "wrong side");
  EXPECT_EQ(stats.ticks, 118u) << "stopped at 100 ms, before tick 98";
  EXPECT_EQ(observer_.at_ms, multiplesOf50(150));
}

TEST_F(LoopWatchTest, chosenAidsReachTheWindowOnce) {
  FakeDevice device(goingDown(0.02, kWatchRate_hz));
  at(20, [this] { home_.requests().setAids({"ines", {}, true}); });
  run(device, {kWatchRate_hz, {}, 300});
  EXPECT_THAT(observer_.chosen_by, ElementsAre("ines"));
}

TEST_F(LoopWatchTest, inAnExamTheAidsAreFixed) {
  FakeDevice device(goingDown(0.02, kWatchRate_hz));
  lesson_.exam = true;
  at(20, [this] { home_.requests().setAids({"ines", usualAids(), false}); });
  at(120, [this] { home_.requests().setAids({"ines", {}, true}); });
  run(device, {kWatchRate_hz, {}, 200});
  EXPECT_TRUE(observer_.chosen_by.empty());
}

// The window's key: off at the next look after 30 ms, on again after 130 ms.
TEST_F(LoopWatchTest, theWindowsKeySwitchesTheCap) {
  SceneSpec scene = paperOneDof();
  scene.effects |= bitOf(Effect::kPalpation);
  useUsualNumbers(effectEntry(Effect::kPalpation), scene);
  model_ = *compile(scene, kWatchRate_hz);
  FakeDevice device([](std::uint64_t /*tick*/, DeviceReading& reading) {
    reading.X_WH = {{0, 0, 0.01}, {1, 0, 0, 0}};
    return DeviceRead::kFresh;
  });
  at(30, [this] { home_.requests().switchCap(); });
  at(130, [this] { home_.requests().switchCap(); });
  ServoSettings settings{kWatchRate_hz, {}, 300};
  settings.starts_capped = true;
  const ServoStats& stats = run(device, settings);
  EXPECT_NEAR(static_cast<double>(stats.flag_ticks[14]), 0.2 * kWatchRate_hz, 4) << "all but 50 to 150 ms";
  EXPECT_FALSE(home_.requests().takeCapSwitch()) << "each counts once";
}

TEST_F(LoopWatchTest, enterCountsOnlyAfterTheFaultWasReported) {
  at(90, [this] { pressEnter(); });
  at(130, [this] { pressEnter(); });  // in a FAULT that has not been reported yet
  const ServoStats& stats = runSilent();
  EXPECT_EQ(stats.fault, Fault::kDeviceSilent);
  EXPECT_EQ(stats.faults, 1u);
  const Fault none = Fault::kNone, silent = Fault::kDeviceSilent;
  EXPECT_THAT(faults(), ElementsAre(none, none, silent, silent, silent, silent, silent, silent, silent));
  std::vector<bool> cause_lasts;
  for (const LessonStatus& status : observer_.statuses) cause_lasts.push_back(status.cause_lasts);
  EXPECT_THAT(cause_lasts, ElementsAre(false, false, true, true, false, false, false, false, false));
  for (const LessonStatus& status : observer_.statuses) EXPECT_TRUE(status.waits);
}

TEST_F(LoopWatchTest, enterEndsAReportedFaultBeforeTheNextLook) {
  at(230, [this] { pressEnter(); });
  const ServoStats& stats = runSilent();
  EXPECT_EQ(stats.fault, Fault::kNone);
  const Fault none = Fault::kNone, silent = Fault::kDeviceSilent;
  EXPECT_THAT(faults(), ElementsAre(none, none, silent, silent, silent, none, none, none, none));
}

TEST_F(LoopWatchTest, sigusr1AndTheWindowsButtonEndAReportedFaultToo) {
  at(230, [this] { home_.requests().acknowledge(); });
  EXPECT_EQ(runSilent().fault, Fault::kNone);
  at(230, [] { ::raise(SIGUSR1); });
  EXPECT_EQ(runSilent().fault, Fault::kNone);
  EXPECT_FALSE(watch_->interrupted());
}

}  // namespace
}  // namespace needlelab::test
