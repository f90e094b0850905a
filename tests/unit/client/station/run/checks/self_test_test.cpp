#include <gmock/gmock.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <csignal>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "client/station/run/checks/self_test.h"
#include "common/base/program.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/blocked_signals.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/device_world.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab {
namespace {

using test::BlockedSignals;
using test::DeviceWorld;
using test::FakeDevice;
using test::kMs;
using testing::HasSubstr;

// A computer, a device and a server without faults.
SelfTestFacts goodFacts() {
  SelfTestFacts f;
  f.device.spec = "virtuose";
  f.device.info = DeviceInfo{"Virtuose", {}, true, true, true};
  f.device.tool_given = true;
  f.device.loop.ticks = f.device.loop.ran = f.device.loop.fresh = 5000;
  f.device.loop.seconds = 5;
  for (int i = 0; i < 5000; ++i) {
    f.device.loop.wakeup.add(40'000);
    f.device.loop.exchange.add(120'000);
  }
  f.device.farthest_m = 0.6;
  f.device.moved_m = 1e-4;
  f.device.noise_m = 1e-5;
  f.device.realtime = {{"memory lock", true, "all memory stays in RAM"}, {"FIFO priority", true, "80"}};
  f.machine = {"computer", 4, "tsc", 1, 20};
  f.monitor.found = {{"HDMI-A-1", 0.61}};
  f.disk = {"/spool", "", 50e9, 0.004, 0.02};
  f.engine = {"", 12, "knee", 30};
  f.servers = {{"lab:7750", "", "server 0.1.0", "station-1", 0.02, 0.001, 0.1}};
  return f;
}

const Check* find(const std::vector<Check>& checks, const std::string& name) {
  for (const Check& check : checks)
    if (check.name == name) return &check;
  return nullptr;
}

TEST(SelfTest, nothingWrongIsAllOk) {
  for (const Check& check : judge(goodFacts())) {
    EXPECT_EQ(check.verdict, Verdict::kOk) << check.name;
    EXPECT_EQ(check.advice, "") << check.name;
  }
}

// One fault at a time: its row reports it with advice, and no other row fails.
TEST(SelfTest, eachFactChangesOnlyItsOwnRow) {
  struct Row {
    const char* check;
    Verdict verdict;
    std::function<void(SelfTestFacts&)> break_it;
  };
  const Row rows[] = {
      {"communication", Verdict::kWarning, [](auto& f) { f.device.loop.fresh = 3900; }},
      {"communication", Verdict::kFailed, [](auto& f) { f.device.loop.fresh = 2400; }},
      {"longest silence", Verdict::kWarning, [](auto& f) { f.device.loop.longest_silence = 5; }},
      {"longest silence", Verdict::kFailed, [](auto& f) { f.device.loop.longest_silence = 6; }},
      {"exchange time", Verdict::kWarning,
       [](auto& f) {
         for (int i = 0; i < 100; ++i) f.device.loop.exchange.add(700'000);
       }},
      {"exchange time", Verdict::kFailed,
       [](auto& f) {
         for (int i = 0; i < 100; ++i) f.device.loop.exchange.add(950'000);
       }},
      {"rate", Verdict::kWarning, [](auto& f) { f.device.loop.missed = 25; }},
      {"rate", Verdict::kFailed, [](auto& f) { f.device.loop.missed = 100; }},
      {"wake-up", Verdict::kWarning,
       [](auto& f) {
         for (int i = 0; i < 100; ++i) f.device.loop.wakeup.add(400'000);
       }},
      {"wake-up", Verdict::kFailed,
       [](auto& f) {
         for (int i = 0; i < 100; ++i) f.device.loop.wakeup.add(2'000'000);
       }},
      {"pose", Verdict::kFailed, [](auto& f) { f.device.loop.bad_poses = 1; }},
      {"place", Verdict::kFailed, [](auto& f) { f.device.farthest_m = 4; }},
      {"noise at rest", Verdict::kWarning, [](auto& f) { f.device.noise_m = 1e-4; }},
      {"noise at rest", Verdict::kFailed, [](auto& f) { f.device.noise_m = 1e-3; }},
      {"noise at rest", Verdict::kFailed, [](auto& f) { f.device.noise_m = std::nan(""); }},
      {"noise at rest", Verdict::kWarning, [](auto& f) { f.device.moved_m = 0.02; }},
      {"speed at rest", Verdict::kWarning, [](auto& f) { f.device.loop.greatest_speed_mps = 0.5; }},
      {"force limits", Verdict::kWarning, [](auto& f) { f.device.info->renders_force = false; }},
      {"torque limits", Verdict::kWarning, [](auto& f) { f.device.info->renders_torque = false; }},
      {"orientation", Verdict::kWarning, [](auto& f) { f.device.info->has_orientation = false; }},
      {"tool", Verdict::kWarning, [](auto& f) { f.device.tool_given = false; }},
      {"FIFO priority", Verdict::kWarning, [](auto& f) { f.device.realtime[1].ok = false; }},
      {"clock", Verdict::kWarning, [](auto& f) { f.machine.clock_resolution_ns = 4000; }},
      {"clock", Verdict::kFailed, [](auto& f) { f.machine.clock_resolution_ns = 4e6; }},
      {"clock", Verdict::kWarning, [](auto& f) { f.machine.clock_source = "hpet"; }},
      {"cores", Verdict::kWarning, [](auto& f) { f.machine.cores = 1; }},
      {"monitor", Verdict::kWarning,
       [](auto& f) {
         f.monitor.found = {{"HDMI-A-1", 27 * kInch_m}};
       }},
      {"monitor", Verdict::kNotChecked, [](auto& f) { f.monitor.found.clear(); }},
      {"letters", Verdict::kWarning, [](auto& f) { f.monitor.viewing.distance_m = 3; }},
      {"spool", Verdict::kWarning, [](auto& f) { f.disk.free_bytes = 500e6; }},
      {"spool", Verdict::kFailed, [](auto& f) { f.disk.free_bytes = 5e6; }},
      {"spool", Verdict::kFailed, [](auto& f) { f.disk.trouble = "read-only"; }},
      {"disk", Verdict::kWarning, [](auto& f) { f.disk.sync_max_s = 0.5; }},
      {"disk", Verdict::kFailed, [](auto& f) { f.disk.sync_max_s = 3; }},
      {"engine", Verdict::kWarning, [](auto& f) { f.engine.tick_median_ns = 100e3; }},
      {"engine", Verdict::kFailed, [](auto& f) { f.engine.trouble = "profile broken"; }},
      {"server", Verdict::kFailed, [](auto& f) { f.servers[0].trouble = "no answer"; }},
      {"server", Verdict::kWarning, [](auto& f) { f.servers[0].connect_s = 3; }},
      {"network", Verdict::kWarning, [](auto& f) { f.servers[0].round_trip_s = 0.4; }},
      {"time of day", Verdict::kWarning, [](auto& f) { f.servers[0].clock_offset_s = -7200; }},
      {"device", Verdict::kFailed, [](auto& f) { f.device.trouble = "no library"; }},
  };
  for (const Row& row : rows) {
    SelfTestFacts facts = goodFacts();
    row.break_it(facts);
    const auto checks = judge(facts);
    const Check* check = find(checks, row.check);
    ASSERT_NE(check, nullptr) << row.check;
    EXPECT_EQ(check->verdict, row.verdict) << row.check << ": " << check->found;
    EXPECT_NE(check->advice, "") << row.check;
    for (const Check& other : checks)
      if (other.name != row.check) {
        EXPECT_EQ(other.verdict, Verdict::kOk) << row.check << " → " << other.name;
      }
  }
}

TEST(SelfTest, theMonitorsSizeIsASuggestion) {
  SelfTestFacts facts = goodFacts();
  facts.monitor.found = {{"DP-1", 27 * kInch_m}, {"HDMI-A-1", 26.9 * kInch_m}};
  const auto checks = judge(facts);
  const Check* check = find(checks, "monitor");
  ASSERT_NE(check, nullptr);
  EXPECT_EQ(check->found, "DP-1 says 27in, HDMI-A-1 says 26.9in; letters are for 24in");
  EXPECT_THAT(check->advice, HasSubstr("--monitor 27in"));
  facts.monitor.found.push_back({"VGA-1", 24.5 * kInch_m});
  EXPECT_EQ(find(judge(facts), "monitor")->verdict, Verdict::kOk) << "one of them is like it";
  facts.monitor.wanted = false;
  for (const char* name : {"monitor", "letters"}) EXPECT_EQ(find(judge(facts), name), nullptr) << name;
}

TEST(SelfTest, everyConditionOfADeviceHasItsRow) {
  const struct {
    std::uint32_t flag;
    Verdict verdict;
    const char* words;
  } rows[] = {
      {kDeviceEmergencyStop, Verdict::kFailed, "emergency stop is pressed, in 2 %"},
      {kDeviceReleased, Verdict::kOk, "no one holds"},
      {kDevicePowerOff, Verdict::kWarning, "no power"},
      {kDeviceOverheated, Verdict::kFailed, "too hot"},
      {kDeviceSaturated, Verdict::kWarning, "more than they can give"},
      {kDeviceOverrun, Verdict::kWarning, "keep the rate"},
      {kDeviceLost, Verdict::kFailed, "unplugged"},
      {kDeviceTrouble, Verdict::kFailed, "reports an error"},
      {kDeviceNotReady, Verdict::kFailed, "not ready"},
  };
  std::uint32_t all = 0;
  for (const auto& row : rows) {
    SelfTestFacts facts = goodFacts();
    facts.device.loop.condition_ticks[static_cast<std::size_t>(std::countr_zero(row.flag))] = 100;
    const auto checks = judge(facts);
    const Check* check = find(checks, "condition");
    ASSERT_NE(check, nullptr);
    EXPECT_EQ(check->verdict, row.verdict) << row.words;
    EXPECT_THAT(check->found, HasSubstr(row.words));
    all |= row.flag;
  }
  EXPECT_EQ(all, kDeviceFlags);
}

TEST(SelfTest, thePlaceIsThatOfTheTip) {
  SelfTestFacts facts = goodFacts();
  facts.device.last_X_WH = {{0.4, 0.1, 0}, {1, 0, 0, 0}};  // upside down
  facts.device.X_HT = {{0, 0, 0.125}, {}};
  EXPECT_THAT(find(judge(facts), "place")->found, HasSubstr("tip at 0.400, 0.100, -0.125 m"));
}

TEST(SelfTest, aServerThatWasNotGivenIsNoFailure) {
  SelfTestFacts facts = goodFacts();
  facts.servers.clear();
  EXPECT_EQ(find(judge(facts), "server")->verdict, Verdict::kNotChecked);
}

TEST(SelfTest, eachServerIsJudgedAndOneGoodServerSuffices) {
  SelfTestFacts facts = goodFacts();
  facts.servers.push_back(facts.servers[0]);
  facts.servers[1].address = "other:7750";
  facts.servers[1].clock_offset_s = 7200;
  EXPECT_EQ(find(judge(facts), "server lab:7750")->verdict, Verdict::kOk);
  EXPECT_EQ(find(judge(facts), "time of day lab:7750")->verdict, Verdict::kOk);
  EXPECT_EQ(find(judge(facts), "time of day other:7750")->verdict, Verdict::kWarning);
  facts.servers[0].trouble = "no answer";
  EXPECT_EQ(find(judge(facts), "server lab:7750")->verdict, Verdict::kWarning);
  facts.servers[1].trouble = "no answer";
  EXPECT_EQ(find(judge(facts), "server other:7750")->verdict, Verdict::kFailed);
}

TEST(SelfTest, endsWithTheWayToTheDelaysMeasurement) {
  SelfTestFacts facts = goodFacts();
  facts.device.delay = LoopDelay{3};
  const auto checks = judge(facts);
  const Check& last = checks.back();
  EXPECT_EQ(last.name, "delay");
  EXPECT_EQ(last.verdict, Verdict::kNotChecked);
  EXPECT_THAT(last.found, HasSubstr("3 ticks"));
  EXPECT_THAT(last.advice, HasSubstr("needlelab-station --device virtuose --measure-delay"));
  facts.device.info->renders_force = false;
  EXPECT_EQ(find(judge(facts), "delay"), nullptr) << "it has no force";
  facts.device.info->renders_force = true;
  facts.device.trouble = "no library";
  EXPECT_EQ(find(judge(facts), "delay"), nullptr) << "it cannot be measured yet";
  facts = goodFacts();
  facts.device.delay = Error{ErrorCode::kInvalidInput, "device-delays.json: delete it"};
  EXPECT_EQ(find(judge(facts), "delay")->verdict, Verdict::kFailed);
}

TEST(SelfTest, aDeviceThatNeverReportsFails) {
  SelfTestFacts facts = goodFacts();
  facts.device.loop.fresh = 0;
  facts.device.loop.longest_silence = 5000;
  const auto checks = judge(facts);
  EXPECT_EQ(find(checks, "pose")->verdict, Verdict::kFailed);
  EXPECT_EQ(find(checks, "communication")->verdict, Verdict::kFailed);
  facts.device.loop = {};
  EXPECT_EQ(find(judge(facts), "communication")->verdict, Verdict::kFailed);
}

TEST(SelfTest, tableAndRowsSayTheSame) {
  SelfTestFacts facts = goodFacts();
  facts.machine.cores = 1;
  facts.disk.sync_max_s = 3;
  const auto checks = judge(facts);
  const std::string text = selfTestText(checks);
  EXPECT_THAT(text, HasSubstr("on one core"));
  EXPECT_THAT(text, HasSubstr("1 warnings, 1 failed"));
  EXPECT_THAT(text, HasSubstr("Do not begin a lesson"));
  const auto json = nlohmann::json::parse(selfTestJson(checks));
  ASSERT_EQ(json["rows"].size(), checks.size());
  for (std::size_t i = 0; i < checks.size(); ++i) {
    EXPECT_EQ(json["rows"][i]["check"], checks[i].name);
    EXPECT_EQ(json["rows"][i]["verdict"], verdictText(checks[i].verdict));
  }
}

// --- measuring ---

std::vector<ZeroForceSample> still(double noise_m, Vec3 drift_mps, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::vector<ZeroForceSample> samples;
  for (int i = 0; i < 5000; ++i) {
    const double t_s = i * 1e-3;
    const Vec3 noise = Vec3{normal(random), normal(random), normal(random)} * noise_m;
    samples.push_back({t_s, {Vec3{0.5, 0, 0} + drift_mps * t_s + noise, {}}, 0});
  }
  return samples;
}

TEST(RestNoise, isTheScatterAndNotTheDrift) {
  // three coordinates with σ each
  EXPECT_NEAR(restNoise_m(still(1e-5, {}, 1)), 1e-5 * std::sqrt(3.0), 5e-7);
  EXPECT_NEAR(restNoise_m(still(1e-5, {0.01, 0, -0.02}, 2)), 1e-5 * std::sqrt(3.0), 5e-7);
  EXPECT_LT(restNoise_m(still(0, {0.01, 0.01, 0}, 3)), 1e-12);
  EXPECT_EQ(restNoise_m({}), 0);
}

TEST(RestNoise, aKnockDoesNotCount) {
  auto samples = still(1e-5, {}, 4);
  for (std::size_t i = 1000; i < 1300; ++i) samples[i].X_WH.p.z += 0.004;
  EXPECT_NEAR(restNoise_m(samples), 1e-5 * std::sqrt(3.0), 1e-6);
}

// Each loop's first tick is due after 2 ms, the owner polls every 50 ms; if both fall on the same time, the
// tick comes first.
class SelfTestDeviceTest : public testing::Test {
 protected:
  DeviceFacts measure(FakeDevice& device, double seconds, double patience_s = 15) {
    DeviceTestSettings settings;
    settings.seconds = seconds;
    settings.patience_s = patience_s;
    const auto log = [](const std::string&) {};
    return measureDevice(device, world_, settings, blocked_.set(), log, stopped_, world_, world_);
  }
  [[nodiscard]] std::int64_t sinceBeginning_ms() { return (world_.nowNs() - begun_ns_) / kMs; }

  const BlockedSignals blocked_{SIGTERM};
  DeviceWorld world_;
  const std::int64_t begun_ns_ = world_.nowNs();
  bool stopped_ = true;
};

TEST_F(SelfTestDeviceTest, getsOnlyZeroForceWhateverItReports) {
  // A device that becomes ready after 50 readings, then jumps around and reports a fault twice in 800.
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.condition = 0;
    if (tick < 50) reading.condition = kDeviceNotReady;
    if (tick >= 50 && tick % 400 < 20) reading.condition = kDeviceEmergencyStop;
    reading.X_WH.p = {0.4 + 0.1 * std::sin(0.3 * static_cast<double>(tick)), 0, 0};
    reading.speed_mps = 3;
    return tick % 7 == 0 ? DeviceRead::kNoUpdate : DeviceRead::kFresh;
  });
  const auto facts = measure(device, 0.8);
  EXPECT_FALSE(stopped_);
  EXPECT_EQ(facts.trouble, "");
  EXPECT_TRUE(facts.realtime.empty()) << "an ordinary thread was asked for";
  // not ready at 50 ms, ready at 100 ms: ends with the 100th reading, seen at 150 ms
  EXPECT_EQ(device.reads, 900u);
  EXPECT_EQ(facts.loop.ran, 800u);
  EXPECT_EQ(facts.loop.missed, 0u);
  // ticks 100 to 899; of these 105, 112 … 896 have no new reading
  EXPECT_EQ(facts.loop.fresh, 800u - 114u);
  EXPECT_EQ(facts.loop.longest_silence, 1u);
  EXPECT_EQ(sinceBeginning_ms(), 1000) << "800 ticks from 152 ms on, the end seen at the next look";
  const auto ticksOf = [&](std::uint32_t bit) {
    return facts.loop.condition_ticks[static_cast<std::size_t>(std::countr_zero(bit))];
  };
  EXPECT_EQ(ticksOf(kDeviceNotReady), 0u) << "it waited for it";
  EXPECT_EQ(ticksOf(kDeviceEmergencyStop), 40u);
  EXPECT_NEAR(facts.moved_m, 0.1, 0.02);
  EXPECT_EQ(facts.loop.greatest_speed_mps, 3);
  // each reading is answered, and each of the two loops writes once more at its end
  EXPECT_EQ(device.writes.size(), 902u);
  for (const Wrench& wrench : device.writes) ASSERT_EQ(wrench, Wrench{});
}

TEST_F(SelfTestDeviceTest, isMeasuredAsItIsWhenThePatienceIsOver) {
  FakeDevice device([](std::uint64_t, DeviceReading& reading) {
    reading.condition = kDeviceNotReady;
    return DeviceRead::kFresh;
  });
  const auto facts = measure(device, 0.1, 0.2);
  EXPECT_FALSE(stopped_);
  EXPECT_EQ(device.reads, 300u);
  EXPECT_EQ(facts.loop.ran, 100u);
  EXPECT_EQ(facts.loop.condition_ticks[30], 100u) << "kDeviceNotReady";
}

TEST_F(SelfTestDeviceTest, aSignalWhileItBecomesReadyEndsTheTest) {
  FakeDevice device([](std::uint64_t, DeviceReading& reading) {
    reading.condition = kDeviceNotReady;
    return DeviceRead::kFresh;
  });
  world_.at(begun_ns_ + 120 * kMs, [] { ::raise(SIGTERM); });
  const auto facts = measure(device, 5);
  EXPECT_TRUE(stopped_);
  EXPECT_EQ(device.reads, 150u) << "seen at the look at 150 ms, ended at the tick behind it";
  EXPECT_EQ(facts.loop.ran, 0u);
  EXPECT_EQ(sinceBeginning_ms(), 200);
}

TEST(SelfTestMachine, sampleScenesAreAllStepped) {
  EXPECT_GE(sampleProfiles().size(), 10u);
  const EngineFacts facts = measureEngine(1000);
  EXPECT_EQ(facts.trouble, "");
  EXPECT_EQ(facts.scenes, sampleProfiles().size());
  EXPECT_GT(facts.tick_median_ns, 0);
  EXPECT_NE(facts.heaviest, "");
}

TEST(SelfTestMachine, theDiskIsMeasuredAndLeftClean) {
  test::TempFolder folder;
  const auto spool = folder.path() / "a" / "spool";
  const DiskFacts facts = measureDisk(spool);
  EXPECT_EQ(facts.trouble, "");
  EXPECT_GT(facts.free_bytes, 0);
  EXPECT_GT(facts.sync_max_s, 0);
  EXPECT_TRUE(std::filesystem::is_empty(spool));
  EXPECT_THAT(measureDisk(folder.write("file", "") / "spool").trouble, HasSubstr("cannot be made"));
}

TEST(SelfTestMachine, anUnreachableServerIsReported) {
  test::TempFolder folder;
  StationOptions options;
  options.key_file = folder.path() / "none.key";
  const ServerFacts facts = measureServer(options, {"127.0.0.1", 1});
  EXPECT_EQ(facts.address, "127.0.0.1:1");
  EXPECT_THAT(facts.trouble, HasSubstr("none.key"));
}

TEST(SelfTestCommand, theSimulatedDevicePasses) {
  test::TempFolder folder;
  StationOptions options;
  options.mode = StationMode::kSelfTest;
  options.seconds = 0.3;
  options.spool = folder.path() / "spool";
  options.json = true;
  options.json_file = folder.path() / "test.json";
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const int code = runSelfTest(options, noSignals());
  const std::string out = testing::internal::GetCapturedStdout();
  const std::string err = testing::internal::GetCapturedStderr();
  // A busy machine may miss ticks; all rows that do not depend on time must pass.
  EXPECT_TRUE(code == kExitDone || code == kExitFailed);
  EXPECT_THAT(out, HasSubstr("simulated Virtuose"));
  EXPECT_THAT(err, HasSubstr("it gives no force"));
  std::ifstream file(options.json_file);
  const auto json = nlohmann::json::parse(file);
  for (const auto& row : json["rows"])
    for (const char* name : {"device", "condition", "pose", "place", "force limits", "engine", "spool"})
      if (row["check"] == name) {
        EXPECT_EQ(row["verdict"], "OK") << row;
      }
}

TEST(SelfTestCommand, wrongInputIsExitCodeTwo) {
  StationOptions options;
  options.device = "nothing";
  testing::internal::CaptureStderr();
  EXPECT_EQ(runSelfTest(options, noSignals()), kExitInvalid);
  options = {};
  options.seconds = 1000;
  EXPECT_EQ(runSelfTest(options, noSignals()), kExitInvalid);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("out of range [0.001, 600]"));
}

}  // namespace
}  // namespace needlelab
