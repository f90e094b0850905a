#include "server/live/limits/peer_lines.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/unit/server/live/log_lines.h"

namespace needlelab {
namespace {

using namespace test;

constexpr std::int64_t kAMinute_ns = LogBound::kMinute_ns;
constexpr std::uint64_t kAMinute = PeerLines::Settings{}.a_minute;

/// `times` lines at once.
void write(PeerLines& lines, const std::string& owner, const PeerLineKind& kind, std::int64_t now_ns,
           std::uint64_t times) {
  for (std::uint64_t i = 0; i < times; ++i) lines.write(owner, kind, now_ns, {{"who", owner}});
}

// The finding: repeated log-ins with one station's key wrote 0.9 MB per second, using a long program name.
TEST(PeerLines, anHoursLogInLinesAreBoundedInBytes) {
  constexpr std::uint64_t kASecond = 20, kSeconds = 3600;
  const std::string program(900, 'x'), owner = "station bench-1";
  PeerLines lines;
  const std::string log = logOf(LogLevel::kInfo, [&] {
    for (std::uint64_t i = 0; i < kSeconds * kASecond; ++i) {
      const auto now_ns = static_cast<std::int64_t>(i * 1'000'000'000 / kASecond);
      lines.write(owner, PeerLine::kLogin, now_ns, {{"who", "bench-1"}, {"program", program}});
      if (i % (5 * kASecond) == 0) lines.reportOmitted(now_ns);
    }
    lines.reportOmitted(INT64_MAX);
  });
  constexpr std::uint64_t kMinutes = kSeconds / 60;
  const std::uint64_t left_out = 60 * kASecond - kAMinute;
  const std::string written = logLine("login_ok", {{"who", "bench-1"}, {"program", program}});
  const std::string said =
      logLine("lines_left_out", {{"who", owner}, {"of", "login_ok"}, {"count", left_out}});
  EXPECT_EQ(countOf(log, written + "\n"), kMinutes * kAMinute);
  EXPECT_EQ(countOf(log, said + "\n"), kMinutes) << "all of them are counted";
  const std::size_t time_and_level = log.find(written);
  EXPECT_EQ(log.size(), kMinutes * (kAMinute * (time_and_level + written.size() + 1) +
                                    (time_and_level + said.size() + 1)));
}

// The finding: a trainee's cookie wrote 1 MB per second with requests to the web port.
TEST(PeerLines, successfulRequestsHaveMoreLinesAndHideNoFailures) {
  PeerLines lines;
  const std::string log = logOf(LogLevel::kInfo, [&] {
    for (const PeerLineKind& kind : {PeerLine::kWebRequestDone, PeerLine::kWebRequestRefused,
                                     PeerLine::kWebRequestForbidden, PeerLine::kWebRequestFailed})
      write(lines, "person tina", kind, 0, 1000);
    lines.reportOmitted(kAMinute_ns);
  });
  const std::uint64_t answered = PeerLines::Settings{}.answered_a_minute;
  EXPECT_EQ(countOf(log, "web_request who=\"person tina\"\n"), answered + 3 * kAMinute);
  EXPECT_EQ(countOf(log, leftOut("\"person tina\"", "web_request/done", 1000 - answered)), 1u);
  for (const char* of : {"web_request/4xx", "web_request/403", "web_request/5xx"})
    EXPECT_EQ(countOf(log, leftOut("\"person tina\"", of, 1000 - kAMinute)), 1u) << of;
}

// The finding: 60 meaningless messages hid the account's forbidden ones.
TEST(PeerLines, noKindOfAnAccountHidesAnotherNorAnotherAccounts) {
  PeerLines lines;
  const std::string log = logOf(LogLevel::kWarning, [&] {
    write(lines, "person tina", PeerLine::kMessageRefused, 0, 1000);
    write(lines, "person tina", PeerLine::kMessageRefusedForRole, 0, 1);
    write(lines, "person tom", PeerLine::kMessageRefused, 0, 1);
    write(lines, "station tina", PeerLine::kMessageRefused, 0, 1);
    write(lines, PeerLines::kStrangers, PeerLine::kMessageRefused, 0, 1);
  });
  EXPECT_EQ(countOf(log, "message_refused who=\"person tina\"\n"), kAMinute + 1);
  for (const char* who : {"\"person tom\"", "\"station tina\"", "strangers"})
    EXPECT_EQ(countOf(log, "message_refused who=" + std::string(who) + "\n"), 1u) << who;
}

// The finding: the number of omitted lines was logged only with the account's next refusal.
TEST(PeerLines, omittedLinesAreCountedPeriodicallyAndAtTheEnd) {
  PeerLines lines;
  const auto saidAt = [&](std::int64_t now_ns) {
    return logOf(LogLevel::kWarning, [&] { lines.reportOmitted(now_ns); });
  };
  (void)logOf(LogLevel::kOff,
              [&] { write(lines, "person tina", PeerLine::kMessageRefusedForRole, 0, kAMinute + 10); });
  EXPECT_EQ(saidAt(kAMinute_ns - 1), "") << "the minute is not over";
  EXPECT_EQ(countOf(saidAt(kAMinute_ns), leftOut("\"person tina\"", "message_refused/ROLE", 10)), 1u);
  EXPECT_EQ(saidAt(10 * kAMinute_ns), "") << "once";
  (void)logOf(LogLevel::kOff, [&] {
    write(lines, "person tina", PeerLine::kMessageRefusedForRole, 11 * kAMinute_ns, kAMinute + 5);
  });
  EXPECT_EQ(countOf(saidAt(INT64_MAX), leftOut("\"person tina\"", "message_refused/ROLE", 5)), 1u);
}

TEST(PeerLines, whoHasGoneIsForgottenAndTheNumberIsNot) {
  PeerLines lines;
  constexpr std::size_t kStations = 1000;
  (void)logOf(LogLevel::kOff, [&] {
    for (std::size_t n = 0; n < kStations; ++n)
      write(lines, "station " + std::to_string(n), PeerLine::kChunkQuarantined, 0, kAMinute + 1);
    // another one reaches each in the next minute, before the timer does
    for (std::size_t n = 0; n < kStations; ++n)
      write(lines, "station " + std::to_string(n), PeerLine::kChunkQuarantined, kAMinute_ns, 1);
  });
  EXPECT_EQ(lines.known(), kStations);
  const std::string log = logOf(LogLevel::kWarning, [&] { lines.reportOmitted(2 * kAMinute_ns); });
  EXPECT_EQ(countOf(log, " of=chunk_quarantined count=1\n"), kStations);
  EXPECT_EQ(lines.known(), 0u);
}

// The finding: each log-in had its own line about missing room.
TEST(PeerLines, wantOfRoomHasALineAnHourOfEachAccount) {
  PeerLines lines;
  const auto writtenAt = [&](const std::string& owner, std::int64_t now_ns) {
    const std::string log = logOf(LogLevel::kWarning, [&] {
      lines.reportOmitted(now_ns);
      write(lines, owner, PeerLine::kNoRoom, now_ns, 1);
    });
    return countOf(log, "no_room who=");
  };
  EXPECT_EQ(writtenAt("person tina", 0), 1u);
  EXPECT_EQ(writtenAt("person tina", 1), 0u);
  EXPECT_EQ(writtenAt("station bench-1", 1), 1u);
  EXPECT_EQ(writtenAt("person tina", 60 * kAMinute_ns - 1), 0u);
  EXPECT_EQ(writtenAt("person tina", 60 * kAMinute_ns), 1u);
  EXPECT_EQ(writtenAt("person tina", 61 * kAMinute_ns), 0u);
}

}  // namespace
}  // namespace needlelab
