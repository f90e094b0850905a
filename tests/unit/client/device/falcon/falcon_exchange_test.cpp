// The packet exchange on virtual time, with a scripted link.
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_exchange.h"
#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/device_condition.h"

namespace needlelab::falcon {
namespace {

using Motors = std::array<std::int16_t, 3>;
constexpr std::int64_t kMs = 1'000'000;

/// Stores the sent packets; answers only on request.
class ScriptedLink final : public FalconLink {
 public:
  Status control(std::uint8_t, std::uint16_t, std::uint16_t) override { return {}; }
  Status write(std::span<const std::uint8_t>, std::chrono::milliseconds) override { return {}; }
  Result<std::size_t> read(std::span<std::uint8_t>, std::chrono::milliseconds) override {
    return std::size_t{0};
  }
  Status startStream(LinkListener&) override { return {}; }
  bool send(const Packet& packet) noexcept override {
    Command command;
    EXPECT_TRUE(decodeCommand(packet, command));
    sent.push_back(command);
    return accepts;
  }
  void wait(std::int64_t) noexcept override {}
  [[nodiscard]] bool lost() const noexcept override { return gone; }
  void stopStream() noexcept override {}

  std::vector<Command> sent;
  bool accepts = true, gone = false;
};

class FalconExchange : public testing::Test {
 protected:
  void answer(std::uint8_t bits = kInHomed, Motors encoder = {}) { raw({encodeReport({encoder, bits})}); }
  void raw(const std::vector<Packet>& packets) {
    std::vector<std::uint8_t> bytes = {0x01, 0x60};
    for (const Packet& packet : packets) bytes.insert(bytes.end(), packet.begin(), packet.end());
    exchange_.onRead(bytes, now_);
  }
  /// Advances one millisecond: sends due packets and answers them at once.
  Command tick(std::uint8_t bits = kInHomed) {
    now_ += kMs;
    const std::size_t before = link_.sent.size();
    exchange_.step(now_);
    if (link_.sent.size() == before) {
      ADD_FAILURE() << "nothing was sent";
      return {};
    }
    exchange_.onSent(true);
    answer(bits);
    return link_.sent.back();
  }
  void request(Motors motor) { boxes_.requests.publish({motor}); }
  std::uint32_t condition() { return boxes_.condition.load(); }

  Mailboxes boxes_;
  ScriptedLink link_;
  std::int64_t now_ = 5'000 * kMs;
  Exchange exchange_{link_, boxes_, now_};
};

TEST_F(FalconExchange, newestWishIsSentAndNewestReportKept) {
  tick();
  request({1, 2, 3});
  request({4, 5, 6});
  EXPECT_EQ(tick().motor, (Motors{4, 5, 6}));
  answer(kInHomed | 0x5, {7, 8, 9});
  TimedReport seen;
  ASSERT_TRUE(boxes_.reports.fetch(seen));
  EXPECT_EQ(seen.report, (Report{{7, 8, 9}, 0x75}));
  EXPECT_EQ(seen.at_ns, now_);
  EXPECT_EQ(condition(), 0u);
}

TEST_F(FalconExchange, oneCommandAMillisecondWithoutDrift) {
  for (int i = 0; i < 100; ++i) tick();
  const std::size_t sent = link_.sent.size();
  // If it is called more often, it waits.
  for (int i = 0; i < 10; ++i) exchange_.step(now_ + i * 90'000);
  EXPECT_EQ(link_.sent.size(), sent);
  // If it is sometimes late by 0.4 ms, it keeps its phase: the next command follows after 0.6 ms.
  now_ += kMs + 400'000;
  exchange_.step(now_);
  exchange_.onSent(true);
  answer();
  EXPECT_EQ(exchange_.step(now_), now_ + 600'000);
}

TEST_F(FalconExchange, motorsRestUntilAllEncodersHaveFoundTheirZero) {
  for (const std::uint8_t homed : {0x00, 0x10, 0x30, 0x60}) {
    tick(homed);
    request({100, 100, 100});
    const Command command = tick(homed);
    EXPECT_EQ(command.motor, Motors{}) << int(homed);
    EXPECT_EQ(command.bits, kOutHome | kOutRed);
    EXPECT_EQ(condition(), kDeviceNotReady);
  }
  tick();
  request({100, 100, 100});
  const Command command = tick();
  EXPECT_EQ(command.motor, (Motors{100, 100, 100}));
  EXPECT_EQ(command.bits, kOutGreen);
  // The device loses power for a moment.
  tick(0x00);
  request({100, 100, 100});
  EXPECT_EQ(tick(0x00).motor, Motors{});
}

TEST_F(FalconExchange, silentHapticThreadMeansZeroTorqueAfter20Ms) {
  tick();
  request({500, -500, 500});
  int ticks = 0;
  while (tick().motor != Motors{} && ticks < 100) ++ticks;
  EXPECT_EQ(ticks, 21) << "the command that takes the request, and those of the next 20 ms";
  EXPECT_EQ(exchange_.counts().starved_times, 1u);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(tick().motor, Motors{});
  EXPECT_EQ(exchange_.counts().starved_times, 1u) << "counted once";
  // The haptic thread runs again.
  request({20, 20, 20});
  EXPECT_EQ(tick().motor, (Motors{20, 20, 20}));
}

TEST_F(FalconExchange, whatWasWishedBeforeTheLinkIsForgotten) {
  request({3000, 3000, 3000});
  Exchange again(link_, boxes_, now_);
  again.step(now_);
  again.onSent(true);
  const std::vector<std::uint8_t> head = {0x01, 0x60};
  std::vector<std::uint8_t> bytes = head;
  const Packet report = encodeReport({{}, kInHomed});
  bytes.insert(bytes.end(), report.begin(), report.end());
  again.onRead(bytes, now_);
  again.step(now_ + kMs);
  EXPECT_EQ(link_.sent.back().motor, Motors{});
}

TEST_F(FalconExchange, twentyBadPacketsInARowAreTroubleUntilAGoodOne) {
  tick();
  Packet bad = encodeReport({{}, kInHomed});
  bad[5] = '?';
  for (int i = 0; i < 19; ++i) raw({bad});
  request({100, 0, 0});
  now_ += kMs;
  exchange_.step(now_);
  EXPECT_EQ(exchange_.trouble(), Exchange::Trouble::kNone);
  EXPECT_EQ(link_.sent.back().motor[0], 100) << "a few are noise";
  exchange_.onSent(true);
  raw({bad, bad});
  request({100, 0, 0});
  now_ += kMs;
  exchange_.step(now_);
  EXPECT_EQ(exchange_.trouble(), Exchange::Trouble::kBadPackets);
  EXPECT_EQ(condition(), kDeviceTrouble);
  EXPECT_EQ(link_.sent.back().motor, Motors{}) << "no torque without eyes";
  EXPECT_EQ(exchange_.counts().bad_packets, 21u);
  exchange_.onSent(true);
  answer();
  request({100, 0, 0});
  EXPECT_EQ(tick().motor[0], 100);
  EXPECT_EQ(condition(), 0u);
}

TEST_F(FalconExchange, silenceIsTroubleAfter100MsAndHopelessAfterASecond) {
  tick();
  const std::int64_t last = now_;
  std::size_t before = link_.sent.size();
  while (now_ < last + 99 * kMs) {
    now_ += kMs;
    exchange_.step(now_);
    exchange_.onSent(true);
  }
  EXPECT_EQ(condition(), 0u);
  EXPECT_GT(link_.sent.size(), before + 10) << "it goes on asking";
  EXPECT_GT(exchange_.counts().unanswered, 10u);
  while (now_ < last + 102 * kMs) {
    now_ += kMs;
    exchange_.step(now_);
    exchange_.onSent(true);
  }
  EXPECT_EQ(condition(), kDeviceTrouble);
  EXPECT_EQ(exchange_.trouble(), Exchange::Trouble::kSilent);
  EXPECT_FALSE(exchange_.timedOut(now_));
  EXPECT_TRUE(exchange_.timedOut(last + 1001 * kMs));
}

TEST_F(FalconExchange, noMoreThanTwoCommandsAreUnderWay) {
  tick();
  const std::size_t before = link_.sent.size();
  for (int i = 1; i <= 5; ++i) {
    exchange_.step(now_ + i * kMs);
    exchange_.onSent(true);
  }
  EXPECT_EQ(link_.sent.size(), before + 2);
}

TEST_F(FalconExchange, aWriteThatIsNotOverIsWaitedFor) {
  tick();
  const std::size_t before = link_.sent.size();
  for (int i = 1; i <= 5; ++i) exchange_.step(now_ + i * kMs);
  EXPECT_EQ(link_.sent.size(), before + 1);
  exchange_.onSent(false);
  exchange_.step(now_ + 6 * kMs);
  EXPECT_EQ(link_.sent.size(), before + 2);
}

TEST_F(FalconExchange, theLastWordIsZeroTorqueAndIsAnswered) {
  tick();
  request({900, 900, 900});
  now_ += kMs;
  exchange_.step(now_);
  // A command with torque is in flight; its answer arrives first and does not count.
  exchange_.startFinalCommand(now_, 500 * kMs);
  EXPECT_EQ(exchange_.step(now_), now_ + kMs);
  EXPECT_EQ(link_.sent.back().motor, (Motors{900, 900, 900})) << "one write at a time";
  exchange_.onSent(true);
  answer();
  EXPECT_FALSE(exchange_.finalCommandOver(now_));
  exchange_.step(now_);
  EXPECT_EQ(link_.sent.back(), (Command{{}, 0}));
  exchange_.onSent(true);
  EXPECT_FALSE(exchange_.finalCommandOver(now_));
  answer();
  EXPECT_TRUE(exchange_.finalCommandOver(now_));
  EXPECT_TRUE(exchange_.finalCommandAnswered());
}

TEST_F(FalconExchange, goodbyeToADeafDeviceEndsInTime) {
  tick();
  const std::size_t before = link_.sent.size();
  const std::int64_t start = now_;
  exchange_.startFinalCommand(now_, 30 * kMs);
  while (!exchange_.finalCommandOver(now_)) {
    now_ = exchange_.step(now_);
    exchange_.onSent(true);
  }
  EXPECT_EQ(now_ - start, 30 * kMs);
  EXPECT_FALSE(exchange_.finalCommandAnswered());
  EXPECT_EQ(link_.sent.size() - before, 5u) << "said every 6 ms";
  exchange_.startFinalCommand(now_, 10'000 * kMs);
  EXPECT_FALSE(exchange_.finalCommandOver(now_));
  link_.gone = true;
  EXPECT_TRUE(exchange_.finalCommandOver(now_)) << "at once";
}

}  // namespace
}  // namespace needlelab::falcon
