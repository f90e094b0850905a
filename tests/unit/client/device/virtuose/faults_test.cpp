// Faults of a Virtuose: one row per fault, with what the device layer must do and by when, exact to the tick
// in a simulated world. The gate's rules hold in every row.
#include <atomic>
#include <chrono>
#include <ostream>
#include <sstream>
#include <thread>

#include "tests/support/scenes/scenes.h"
#include "tests/support/time/gate_rules.h"
#include "tests/support/time/haptic_thread.h"
#include "tests/unit/client/device/virtuose/bench.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// The device's own controller: one cycle per millisecond.
class StandinCycles final : public Turns {
 public:
  StandinCycles(TimeSource& time, Standin& standin) : time_(time), standin_(standin) {}
  std::optional<std::int64_t> turn() noexcept override {
    if (stop) return std::nullopt;
    standin_.advance(kTick_s);
    return time_.nowNs() + kMs;
  }
  void rest(std::int64_t until_ns) noexcept override { time_.sleepUntilNs(until_ns); }
  bool stop = false;

 private:
  TimeSource& time_;
  Standin& standin_;
};

/// A lesson with haptic thread, keeper and device; the hand has pushed the needle in at 20 mm/s and continues
/// for another 0.9 s. The next tick is in a millisecond.
class VirtuoseLesson {
 public:
  VirtuoseLesson() {
    standin.command("place 0 0 0.01 1 0 0 0");
    const Status done = device.open(1000);
    EXPECT_TRUE(done.ok()) << done.error().message;
    cycles_running_ = world.start(cycles_, {"virtuose", 0});
    goOnMs(0.5);
    haptic.on_tick = [this] { rules_.check(haptic); };
    keeper_ = std::make_unique<DeviceMaintenance>(device, world, world);
    haptic_running_ = world.start(haptic, {"haptic", 0});
    standin.command("hand 0 0 -0.03 1 0 0 0 2.0");
    goOnMs(1'100);
    EXPECT_GT(haptic.force_N(), 0.4);
    EXPECT_GT(standin.feltForce_N(), 0.4);
  }
  ~VirtuoseLesson() {
    haptic.stop();
    haptic_running_.reset();
    keeper_.reset();
    device.close();
    EXPECT_EQ(device.status(), "");
    cycles_.stop = true;
    cycles_running_.reset();
  }
  VirtuoseLesson(const VirtuoseLesson&) = delete;
  VirtuoseLesson& operator=(const VirtuoseLesson&) = delete;

  void goOnMs(double ms) { world.sleepForNs(static_cast<std::int64_t>(ms * kMs)); }
  /// Commands of the stand-in, plus `hang MS` for the haptic thread, separated by semicolons.
  void commands(const std::string& text) {
    std::istringstream all(text);
    for (std::string one; std::getline(all, one, ';');)
      if (one.starts_with("hang "))
        haptic.hangUntil(world.nowNs() + std::stol(one.substr(5)) * kMs);
      else
        standin.command(one);
  }
  [[nodiscard]] std::uint32_t condition() const { return haptic.reading().condition; }
  [[nodiscard]] Fault fault() const { return haptic.gate().fault(); }

  Standin standin;
  DeviceWorld world;
  VirtuoseDevice device{[] {
                          VirtuoseOptions options;
                          options.library = kStandinLibrary;
                          return options;
                        }(),
                        world, world};
  SceneModel model = *compile(paperOneDof(), 1000);
  HapticThread haptic{world, device, model};

 private:
  StandinCycles cycles_{world, standin};
  GateRules rules_{device.info().limits, [](const std::string& what) { ADD_FAILURE() << what; }};
  std::unique_ptr<DeviceMaintenance> keeper_;
  std::unique_ptr<RunningTurns> cycles_running_, haptic_running_;
};

constexpr std::int64_t kNot = -1;

struct VirtuoseFault {
  const char* begins;
  std::int64_t lasts_ms;
  const char* ends;
  // during the fault
  std::uint32_t condition;         ///< of the reading at its end
  std::int64_t said_ms;            ///< the latest first tick whose reading has the condition
  Fault fault;                     ///< of the gate
  std::int64_t force_ms, felt_ms;  ///< the end, at the latest, of writing and feeling it; kNot: none
  const char* words;               ///< of the status
  // afterwards
  std::int64_t good_ms;       ///< the latest tick with a position and no condition
  const char* tries_ms = "";  ///< attempts to reopen: the latest time of each; at most 49 ms earlier
};

constexpr const char *kAway = "the link is lost and is looked for again. ",
                     *kNoService = "connecting failed with error 2";

const VirtuoseFault kVirtuoseFaults[] = {
    // sensors: position, dead man and emergency stop are read each tick, the others in turn
    {"estop press", 100, "estop free;switch 1", kDeviceEmergencyStop | kDevicePowerOff, 6,
     Fault::kEmergencyStop, 21, 1, "emergency stop", 6},
    {"dead_man 0", 200, "dead_man 1", kDeviceReleased | kDevicePowerOff, 6, Fault::kNone, 20, 1,
     "holds the handle", 6},
    {"switch 0", 200, "switch 1", kDevicePowerOff, 6, Fault::kNone, 25, 1, "power switch", 6},
    {"overheat 1", 100, "overheat 0", kDeviceOverheated, 6, Fault::kDeviceOverheated, 26, 28, "too hot", 6},
    {"alarm 0x8000", 100, "alarm 0", kDeviceSaturated, 6, Fault::kNone, kNot, kNot, "at their limit", 6},
    {"alarm 0x20000", 100, "alarm 0", kDeviceOverrun, 6, Fault::kNone, kNot, kNot, "too fast", 6},
    {"alarm 0x40000", 100, "alarm 0", kDeviceTrouble, 6, Fault::kDeviceTrouble, 26, 28, "its own position",
     6},
    {"failure 0x4", 100, "failure 0", kDeviceTrouble, 6, Fault::kDeviceTrouble, 26, 28, "encoder 3", 6},
    // readings
    {"bad_turn 1.1", 5, "bad_turn 1", 0, kNot, Fault::kNone, kNot, kNot, "", 1},
    {"bad_turn 1.1", 40, "bad_turn 1", 0, kNot, Fault::kOrientationInvalid, 26, 28, "", 1},
    {"bad_turn 0.5", 40, "bad_turn 1", 0, kNot, Fault::kOrientationInvalid, 26, 28, "", 1},
    {"bad_turn 1.000001", 40, "bad_turn 1", 0, kNot, Fault::kNone, kNot, kNot, "", 1},
    {"jump 0.5 0 0", 40, "jump 0 0 0", 0, kNot, Fault::kTipTooFast, 26, 28, "", 1},
    {"fail virtGetSpeed 11", 900, "fail virtGetSpeed 0", kDeviceTrouble, 1, Fault::kDeviceTrouble, 21, 23,
     "virtGetSpeed failed with error 11, the device reports a hardware error", 1},
    {"fail virtGetSpeed 11", 1'040, "fail virtGetSpeed 0", kDeviceTrouble, 1, Fault::kDeviceTrouble, 21, 23,
     "error 11", 1, "1000"},
    // the link: the keeper looks 20 times a second; the service keeps a connection for 2 s if it did not see
    // it end
    {"link_down 0.02", 49, "link_down 0", kDeviceLost, 1, Fault::kDeviceLost, 21, kNot, kAway, 3, "50"},
    {"link_down 0.2", 600, "link_down 0", kDeviceLost, 1, Fault::kDeviceLost, 21, kNot, kNoService, 3'100,
     "50 550 1550 3550"},
    {"daemon 0", 30'000, "daemon 1", kDeviceLost, 1, Fault::kDeviceLost, 21, 1, kNoService, 5'001,
     "50 550 1550 3550 7550 12550 17550 22550 27550 32550"},
    // the haptic thread: the device's own watchdog cuts the connection after two seconds
    {"hang 100", 99, "link_down 0", 0, kNot, Fault::kNone, kNot, kNot, "", 2},
    {"hang 3000", 2'999, "link_down 0", 0, kNot, Fault::kNone, kNot, 2'003, "", 60, "3000"},
};

// names a row in the list of tests
std::ostream& operator<<(std::ostream& out, const VirtuoseFault& row) {
  return out << row.begins;
}

class VirtuoseFaults : public testing::TestWithParam<VirtuoseFault> {};
INSTANTIATE_TEST_SUITE_P(Rows, VirtuoseFaults, testing::ValuesIn(kVirtuoseFaults), [](const auto& row) {
  std::string name = std::to_string(row.index) + "_";
  for (const char c : std::string(row.param.begins))
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
  return name;
});

TEST_P(VirtuoseFaults, areReportedAndRepairedInTime) {
  const VirtuoseFault& row = GetParam();
  VirtuoseLesson lesson;
  std::vector<std::int64_t> tries_ms;
  std::int64_t ms = 0, said_ms = kNot, force_ms = 0, felt_ms = 0;
  long openings = lesson.standin.state().openings;
  const auto goOn = [&] {
    lesson.goOnMs(1);
    ++ms;
    if (const long now = lesson.standin.state().openings; now != openings) {
      EXPECT_EQ(now, ++openings);
      tries_ms.push_back(ms);
    }
  };
  lesson.commands(row.begins);
  while (ms < row.lasts_ms) {
    goOn();
    if (said_ms == kNot && (lesson.condition() & row.condition) == row.condition) said_ms = ms;
    if (lesson.haptic.force_N() > 0) force_ms = ms + 1;
    if (lesson.standin.feltForce_N() > 0) felt_ms = ms + 1;
  }
  EXPECT_EQ(lesson.condition(), row.condition);
  if (row.condition != 0) EXPECT_LE(said_ms, row.said_ms);
  EXPECT_EQ(lesson.fault(), row.fault);
  EXPECT_THAT(lesson.device.status(), HasSubstr(row.words));
  if (row.force_ms == kNot)
    EXPECT_EQ(force_ms, row.lasts_ms + 1);
  else
    EXPECT_LE(force_ms, row.force_ms);
  if (row.felt_ms == kNot)
    EXPECT_EQ(felt_ms, row.lasts_ms + 1);
  else
    EXPECT_LE(felt_ms, row.felt_ms);

  lesson.commands(row.ends);
  const std::int64_t good_ms = ms + row.good_ms;
  do goOn();
  while ((!lesson.haptic.fresh() || (lesson.condition() & ~kDeviceOverrun) != 0) && ms < good_ms);
  EXPECT_LE(ms, good_ms);
  EXPECT_EQ(lesson.condition(), 0u);
  if (lesson.fault() != Fault::kNone) {
    // an acknowledgement in the tissue does not count
    lesson.haptic.acknowledge();
    for (int tick = 0; tick < 50; ++tick) {
      goOn();
      if (tick >= 20) EXPECT_EQ(lesson.haptic.force_N(), 0);
      if (tick > 25) EXPECT_EQ(lesson.standin.feltForce_N(), 0);
    }
    EXPECT_NE(lesson.fault(), Fault::kNone);
  }
  lesson.standin.command("hand 0 0 0.01 1 0 0 0 0.1");
  for (int tick = 0; tick < 400; ++tick) goOn();
  lesson.haptic.acknowledge();
  lesson.standin.command("hand 0 0 -0.03 1 0 0 0 1.0");
  for (int tick = 0; tick < 900; ++tick) goOn();
  EXPECT_EQ(lesson.fault(), Fault::kNone);
  EXPECT_EQ(lesson.device.status(), "");
  EXPECT_GT(lesson.haptic.force_N(), 0.4);
  EXPECT_GT(lesson.standin.feltForce_N(), 0.4);
  std::istringstream expected(row.tries_ms);
  for (const std::int64_t try_ms : tries_ms) {
    std::int64_t most_ms = 0;
    ASSERT_TRUE(expected >> most_ms) << "a try after " << try_ms << " ms";
    EXPECT_LE(try_ms, most_ms);
    EXPECT_GT(try_ms, most_ms - 50);
  }
  EXPECT_TRUE((expected >> std::ws).eof()) << "more tries";
}

TEST(VirtuoseWorld, afterARecoveryTheWaitsBeginAtHalfASecondAgain) {
  VirtuoseLesson lesson;
  lesson.standin.command("daemon 0");
  lesson.goOnMs(8'000);
  lesson.standin.command("daemon 1");
  while (!lesson.haptic.fresh()) lesson.goOnMs(1);
  lesson.standin.command("daemon 0");
  const long openings = lesson.standin.state().openings;
  for (const auto& [wait_ms, tries] : {std::pair{480, 0}, {20, 1}, {480, 1}, {20, 2}}) {
    lesson.goOnMs(wait_ms);
    EXPECT_EQ(lesson.standin.state().openings - openings, tries) << wait_ms;
  }
}

// ---- without a loop

TEST_F(VirtuoseTest, aLostLinkIsReportedAtOnceAndNeverUsedAgain) {
  open();
  ticks(100);
  standin_.command("link_down 0.3");
  EXPECT_EQ(tick(), DeviceRead::kNoUpdate);
  EXPECT_EQ(reading_.condition, std::uint32_t{kDeviceLost});
  // Without maintain() the haptic thread does not touch the connection, even when the link is up again.
  ticks(500);
  EXPECT_EQ(reading_.condition, std::uint32_t{kDeviceLost});
  EXPECT_EQ(standin_.complaints(), "virtGetPosition:6");
  EXPECT_THAT(device_.status(), HasSubstr("virtGetPosition failed with error 6"));
}

TEST_F(VirtuoseTest, aDeviceMissingAtStartIsReportedAndMayAppearLater) {
  standin_.command("daemon 0");
  const Status status = device_.open(1000);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kUnavailable);
  for (const char* part : {"127.0.0.1#53210", "device is on", "Ethernet cable", "service running"})
    EXPECT_THAT(status.error().message, HasSubstr(part));
  EXPECT_EQ(tick(), DeviceRead::kNoUpdate);
  standin_.command("daemon 1");
  open();
  EXPECT_EQ(tick(), DeviceRead::kFresh);
}

TEST_F(VirtuoseTest, closingALostDeviceLeavesNothingOpen) {
  open();
  ticks(10);
  standin_.command("daemon 0");
  ticks(10);
  device_.maintain();
  device_.close();
  EXPECT_EQ(device_.status(), "");
  standin_.command("daemon 1");
  EXPECT_EQ(standin_.state().open_contexts, 0);
  device_.maintain();  // and it is not reopened on its own
  EXPECT_EQ(standin_.state().open_contexts, 0);
}

// the hand-over between the haptic thread and maintain, for ThreadSanitizer
TEST_F(VirtuoseTest, threadsHandTheConnectionOverCleanly) {
  standin_.useRealTime();
  VirtuoseOptions options = standinOptions();
  options.keep_alive = options.first_retry = options.longest_retry = 1ms;
  options.timeout_s = 0.005;
  VirtuoseDevice device(options);
  ASSERT_TRUE(device.open(1000).ok());

  std::atomic<bool> done{false};
  std::atomic<int> fresh{0}, lost{0};
  std::thread haptic([&] {
    DeviceReading reading;
    while (!done.load()) {
      if (device.read(reading) == DeviceRead::kFresh)
        fresh.fetch_add(1);
      else if ((reading.condition & kDeviceLost) != 0)
        lost.fetch_add(1);
      device.write({});
      std::this_thread::sleep_for(500us);
    }
  });
  std::thread keeper([&] {
    while (!done.load()) {
      device.maintain();
      static_cast<void>(device.status());
      std::this_thread::sleep_for(1ms);
    }
  });
  // a busy machine may take long; ctest's time limit ends a wait for something that never happens
  const auto awaitFive = [](const std::atomic<int>& count) {
    const int before = count.load();
    while (count.load() < before + 5) std::this_thread::sleep_for(1ms);
  };
  for (int round = 0; round < 10; ++round) {
    awaitFive(fresh);
    standin_.command("daemon 0");
    awaitFive(lost);
    standin_.command("daemon 1");
  }
  awaitFive(fresh);
  done.store(true);
  haptic.join();
  keeper.join();
  device.close();
  EXPECT_EQ(standin_.state().open_contexts, 0);
}

}  // namespace
}  // namespace needlelab::test
