// A thread's work pass by pass: on a real thread and in the simulated world.
#include "client/device/turns.h"

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "client/device/device.h"
#include "tests/support/time/device_world.h"

namespace needlelab::test {
namespace {

/// Runs a function once per turn.
class ScriptedTurns final : public Turns {
 public:
  explicit ScriptedTurns(std::function<std::optional<std::int64_t>()> turn) : turn_(std::move(turn)) {}
  std::optional<std::int64_t> turn() noexcept override { return turn_(); }
  void rest(std::int64_t until_ns) noexcept override { rests.push_back(until_ns); }
  std::vector<std::int64_t> rests;

 private:
  std::function<std::optional<std::int64_t>()> turn_;
};

TEST(MachineThreads, aThreadCallsTurnAndRestsBetweenUntilTheEnd) {
  const auto owner = std::this_thread::get_id();
  int turns = 0;
  bool is_other = false;
  ScriptedTurns work([&]() -> std::optional<std::int64_t> {
    is_other = std::this_thread::get_id() != owner;
    ++turns;
    return turns < 4 ? std::optional<std::int64_t>(100 * turns) : std::nullopt;
  });
  machineThreads().start(work, {"turns", 0}).reset();  // waits for it to end
  EXPECT_EQ(turns, 4);
  EXPECT_TRUE(is_other);
  EXPECT_EQ(work.rests, (std::vector<std::int64_t>{100, 200, 300}));
}

/// Appends its letter every `period`, `left` times.
ScriptedTurns sayer(DeviceWorld& world, std::string& said, char letter, std::int64_t period_ns, int& left) {
  return ScriptedTurns([&world, &said, letter, period_ns, &left]() -> std::optional<std::int64_t> {
    if (left-- == 0) return std::nullopt;
    said += letter;
    return world.nowNs() + period_ns;
  });
}

TEST(Turns, threadsTakeTurnsInTheOrderOfTheirDueTimes) {
  DeviceWorld world;
  std::string said;
  int a_left = 100, b_left = 100;
  ScriptedTurns a = sayer(world, said, 'a', 2 * kMs, a_left), b = sayer(world, said, 'b', 3 * kMs, b_left);
  const auto running_a = world.start(a, {"a", 0}), running_b = world.start(b, {"b", 0});
  world.at(world.nowNs() + 5 * kMs, [&] { said += '!'; });
  const std::int64_t start_ns = world.nowNs();
  world.sleepForNs(8 * kMs);
  EXPECT_EQ(said, "ababa!aba");  // at 0, 2, 3, 4, 6 and 8 ms; at 6 ms a goes first because it began first
  EXPECT_EQ(world.nowNs(), start_ns + 8 * kMs);
  a_left = b_left = 0;
}

TEST(Turns, aSleeperInItsTurnLetsTheOthersGoOn) {
  DeviceWorld world;
  std::string said;
  int left = 100;
  ScriptedTurns other = sayer(world, said, 'o', kMs, left);
  bool once = true;
  ScriptedTurns sleeper([&]() -> std::optional<std::int64_t> {
    if (!std::exchange(once, false)) return std::nullopt;
    said += '(';
    world.sleepForNs(3 * kMs);
    said += ')';
    return world.nowNs();
  });
  const auto running = world.start(sleeper, {"sleeper", 0}), running_other = world.start(other, {"other", 0});
  world.sleepForNs(5 * kMs);
  EXPECT_EQ(said, "(oooo)oo");
  left = 0;
}

TEST(Turns, anEventOrLatenessMovesAWakeUp) {
  DeviceWorld world;
  std::vector<std::int64_t> turns_ns;
  const std::int64_t start_ns = world.nowNs();
  std::int64_t event_ns = start_ns + 4 * kMs;
  bool ends = false;
  ScriptedTurns work([&]() -> std::optional<std::int64_t> {
    if (ends) return std::nullopt;
    turns_ns.push_back(world.nowNs() - start_ns);
    if (world.nowNs() >= event_ns) event_ns = kNever;
    return world.nowNs() + 10 * kMs;
  });
  world.listen("work", [&] { return event_ns; });
  world.wakeLate("work", [] { return kMs; });
  const auto running = world.start(work, {"work", 0});
  world.sleepForNs(20 * kMs);
  EXPECT_EQ(turns_ns, (std::vector<std::int64_t>{0, 5 * kMs, 16 * kMs}));
  ends = true;
}

TEST(Turns, theSeedDecidesWhoIsFirstAmongEqualsAndAlwaysTheSame) {
  const auto play = [](std::uint64_t seed) {
    DeviceWorld world(seed);
    std::string said;
    int a_left = 50, b_left = 50;
    ScriptedTurns a = sayer(world, said, 'a', kMs, a_left), b = sayer(world, said, 'b', kMs, b_left);
    const auto running_a = world.start(a, {"a", 0}), running_b = world.start(b, {"b", 0});
    world.sleepForNs(60 * kMs);
    return said;
  };
  EXPECT_EQ(play(1), play(1));
  EXPECT_NE(play(1), play(2));
  EXPECT_EQ(play(0).substr(0, 6), "ababab");
}

class WatchedDevice final : public Device {
 public:
  explicit WatchedDevice(TimeSource& time) : time_(time) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double) override { return {}; }
  DeviceRead read(DeviceReading&) noexcept override { return DeviceRead::kNoUpdate; }
  void write(const GuardedWrench&) noexcept override {}
  void maintain() override { maintained_ns.push_back(time_.nowNs()); }
  [[nodiscard]] std::string status() override { return "looked " + std::to_string(maintained_ns.size()); }
  void close() noexcept override {}
  std::vector<std::int64_t> maintained_ns;

 private:
  TimeSource& time_;
  DeviceInfo info_;
};

TEST(DeviceMaintenance, looksTwentyTimesASecondAndKeepsTheStatus) {
  DeviceWorld world;
  WatchedDevice device(world);
  {
    const DeviceMaintenance keeper(device, world, world);
    EXPECT_EQ(keeper.status(), "");
    world.sleepForNs(999 * kMs);
    EXPECT_EQ(keeper.status(), "looked 20");
  }
  ASSERT_EQ(device.maintained_ns.size(), 20u);
  for (std::size_t i = 1; i < 20; ++i)
    EXPECT_EQ(device.maintained_ns[i] - device.maintained_ns[i - 1], 50 * kMs);
}

}  // namespace
}  // namespace needlelab::test
