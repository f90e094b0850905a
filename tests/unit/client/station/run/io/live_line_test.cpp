#include <fcntl.h>
#include <gmock/gmock.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "client/station/run/io/live_line.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/sim_state.h"
#include "tests/unit/client/station/run/loop/loop_fixture.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;
using testing::Not;

LiveView example() {
  LiveView view;
  view.time_s = 67.9;
  view.sample.phase = static_cast<std::uint8_t>(Phase::kInserting);
  view.sample.layer = 2;
  view.sample.insertion_m = 0.02341;
  view.sample.force_W_N[0] = 0.3;
  view.sample.force_W_N[2] = 0.4;
  view.wakeup = {1000, 25'300, 46'000, 90'000, 452'000};
  view.missed_ticks = 3;
  view.spool = "spool 2 chunks";
  view.server = "server away";
  return view;
}

// The output of a pipe or a pseudo-terminal so far.
std::string readAll(int file) {
  std::string text(4096, '\0');
  ::fcntl(file, F_SETFL, O_NONBLOCK);
  const ssize_t got = ::read(file, text.data(), text.size());
  text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  return text;
}

TEST(LiveLine, tellsPlaceForceTimingSpoolAndServer) {
  EXPECT_EQ(liveText(example()),
            "1:07  going in layer 3 23.4 mm 0.50 N | wake-up p50 25 p99 46 max 452 µs, 3 missed | "
            "spool 2 chunks | server away");
  LiveView outside = example();
  outside.sample.phase = static_cast<std::uint8_t>(Phase::kFree);
  outside.sample.layer = -1;
  EXPECT_THAT(liveText(outside), Not(HasSubstr("mm")));
  LiveView named = example();
  named.layer = "muscle";
  EXPECT_THAT(liveText(named), HasSubstr("going in muscle 23.4 mm"));
}

TEST(LiveLine, showsTheAidsThatTheExerciseAllows) {
  LiveView view = example();
  view.aids = {.phase = false, .layer = false, .depth = true, .force = false};
  EXPECT_THAT(liveText(view), HasSubstr("1:07  23.4 mm | wake-up"));
  view.aids = {.phase = false, .layer = false, .depth = false, .force = false};
  EXPECT_THAT(liveText(view), HasSubstr("1:07  practising | wake-up"));
  view.fault = Fault::kEmergencyStop;
  EXPECT_THAT(liveText(view), HasSubstr("FAULT")) << "never hidden";
}

TEST(LiveLine, aFaultComesFirstAndOtherwiseAHold) {
  LiveView view = example();
  view.hold = "the dead-man switch is released";
  EXPECT_THAT(liveText(view), HasSubstr("1:07  NO FORCE: the dead-man switch is released | going in"));
  view.fault = Fault::kEmergencyStop;
  EXPECT_THAT(liveText(view), HasSubstr("1:07  FAULT: the emergency stop is pressed | going in"));
  EXPECT_THAT(liveText(view), Not(HasSubstr("NO FORCE")));
}

TEST(LiveLine, isCutBetweenCharactersNotWithinThem) {
  EXPECT_EQ(cutToWidth("1 µs µs", 4), "1 µs");
  EXPECT_EQ(cutToWidth("1 µs µs", 6), "1 µs µ");
  EXPECT_EQ(cutToWidth("short", 80), "short");
  EXPECT_EQ(cutToWidth("any", 0), "");
}

TEST(LiveLine, elsewhereThanOnATerminalALineEveryTenSeconds) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  LiveLine line(ends[1]);
  std::int64_t now = 5'000'000'000;
  EXPECT_FALSE(line.due(now)) << "a short lesson has no such line";
  now += 10'000'000'000;
  ASSERT_TRUE(line.due(now));
  line.show(example(), now);
  EXPECT_FALSE(line.due(now + 9'900'000'000));
  EXPECT_TRUE(line.due(now + 10'000'000'000));
  line.printMessage("a message");
  line.end();
  EXPECT_EQ(readAll(ends[0]), liveText(example()) + "\na message\n");
  ::close(ends[0]);
  ::close(ends[1]);
}

TEST(LiveLine, onATerminalItIsRewrittenInPlaceBelowMessages) {
  int terminal = -1, screen = -1;
  winsize size{};
  size.ws_col = 31;
  size.ws_row = 24;
  if (::openpty(&screen, &terminal, nullptr, nullptr, &size) != 0) GTEST_SKIP() << "no pseudo-terminal here";
  LiveLine line(terminal);
  std::int64_t now = 0;
  EXPECT_TRUE(line.due(now));
  line.show(example(), now);
  const std::string shown = cutToWidth(liveText(example()), 30);
  EXPECT_EQ(readAll(screen), "\r\x1b[K" + shown);
  EXPECT_FALSE(line.due(now + 900'000'000));
  EXPECT_TRUE(line.due(now + 1'000'000'000));
  line.printMessage("a message");
  EXPECT_EQ(readAll(screen), "\r\x1b[Ka message\r\n" + shown);
  line.end();
  EXPECT_EQ(readAll(screen), "\r\n");
  line.printMessage("later");
  EXPECT_EQ(readAll(screen), "later\r\n");
  ::close(screen);
  ::close(terminal);
}

TEST(LiveView, holdsSpoolAndServerInFewWords) {
  EXPECT_EQ(holdText(0), "");
  EXPECT_EQ(holdText(kDeviceSaturated | kDeviceEmergencyStop), "") << "said, or a fault: no hold";
  EXPECT_EQ(holdText(kDeviceReleased | kDeviceSaturated), "no one holds the handle");
  EXPECT_EQ(holdText(kDevicePowerOff), "the motors have no power");
  EXPECT_EQ(holdText(kDeviceNotReady), "the device is not ready yet");
  EXPECT_EQ(holdText(kFlagStartedInside), "the needle began in the tissue, take it out once");
  EXPECT_EQ(holdText(kFlagStartedInside | kFlagCapped), "the cap began on the skin, lift it off once");
  SpoolWriterCounts counts;
  EXPECT_EQ(spoolText(counts), "recording");
  counts.disk_error = "no space left";
  EXPECT_EQ(spoolText(counts), "NOT RECORDING: no space left");
  UplinkState server;
  server.chunks_left = 1;
  EXPECT_EQ(serverText(server), "server away, 1 chunk waits");
  server.connected = true;
  EXPECT_EQ(serverText(server), "server");
  server.chunks_left = 12;
  EXPECT_EQ(serverText(server), "server, 12 chunks behind");
  server.server_full = "the server's disk is full";
  EXPECT_EQ(serverText(server), "server has no room, 12 chunks wait");
  server.denied = true;
  EXPECT_EQ(serverText(server), "server refuses");
}

class LiveViewerTest : public LoopFixture {};

TEST_F(LiveViewerTest, showsTheNewestTickOfTheLoop) {
  FakeDevice device(goingDown(0.02, kRate));
  clock_.late_ns[100] = 2 * kTick_ns;
  std::unique_ptr<LiveViewer> viewer;
  LiveView seen;
  device.on_write = [&](std::uint64_t tick) {
    if (viewer == nullptr)
      viewer = std::make_unique<LiveViewer>(*loop_, kRate, std::vector<std::string>{"skin"});
    if (tick == 351) seen = viewer->look("recording", "server");
  };
  run(device, {kRate, {}, 400});
  EXPECT_EQ(seen.sample.tick, 349u) << "the tick before the one that is being rendered";
  EXPECT_DOUBLE_EQ(seen.time_s, 0.349);
  EXPECT_EQ(seen.layer, "skin");
  EXPECT_EQ(seen.missed_ticks, 2u);
  EXPECT_EQ(seen.wakeup.total, 349u);
  EXPECT_GE(seen.wakeup.max_ns, 2 * kTick_ns);
  EXPECT_THAT(liveText(seen), HasSubstr("0:00  going in skin 6.0 mm 1.00 N"));
}

}  // namespace
}  // namespace needlelab::test
