#include "server/base/log.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

TEST(Log, valuesAreKeyEqualsValue) {
  EXPECT_EQ(logLine("login_ok", {{"conn", 7}, {"who", "anna"}, {"peer", "[::1]:80"}}),
            "login_ok conn=7 who=anna peer=[::1]:80");
}

TEST(Log, aHostileNameCannotForgeALine) {
  EXPECT_EQ(logLine("login_refused", {{"name", "x\nerror forged a=\"b\" \\ \x7f"}}),
            "login_refused name=\"x\\x0aerror forged a=\\\"b\\\" \\\\ \\x7f\"");
}

TEST(Log, aHostileNameCannotCommandATerminal) {
  const std::string line = logLine("login_refused", {{"name",
                                                      "a\xc2\x9b"
                                                      "2J"}});
  EXPECT_EQ(line.find("\xc2\x9b"), std::string::npos) << line;
  EXPECT_NE(line.find("\\x9b2J"), std::string::npos) << line;
  EXPECT_EQ(logLine("e", {{"k", "M\u00fcller"}}), "e k=\"M\u00fcller\"");
}

TEST(Log, emptyAndLongValuesAreMarked) {
  EXPECT_EQ(logLine("e", {{"k", ""}}), "e k=\"\"");
  EXPECT_LT(logLine("e", {{"k", std::string(100'000, 'a')}}).size(), 600u);
}

TEST(Log, whatIsEscapedMakesNoLongerLine) {
  for (const char* const piece : {"a", "\"", "\x01", "\xc3\xbc"}) {
    std::string text;
    for (int i = 0; i < 1000; ++i) text += piece;
    EXPECT_LT(logLine("e", {{"k", text}}).size(), 520u) << piece;
    EXPECT_GT(logLine("e", {{"k", text}}).size(), 490u) << piece;
    EXPECT_LT(logMembers("e", {{"k", text}}).size(), 540u) << piece;
    EXPECT_GT(logMembers("e", {{"k", text}}).size(), 490u) << piece;
  }
}

TEST(Log, jsonLinesAreOneObjectEachForAnyContent) {
  const std::string hostile = "x\n\"},{\"level\":\"error\" \\ \xff\x9b" + std::string(1000, 'y');
  const std::string line =
      "{" + logMembers("login_refused", {{"conn", 7}, {"name", hostile}, {"peer", "[::1]:80"}}) + "}";
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const auto json = nlohmann::json::parse(line, nullptr, false);
  ASSERT_TRUE(json.is_object()) << line;
  EXPECT_EQ(json.size(), 4u) << "no one adds a member";
  EXPECT_EQ(json["event"], "login_refused");
  EXPECT_EQ(json["conn"], 7) << "a number stays one";
  EXPECT_EQ(json["peer"], "[::1]:80");
  EXPECT_LT(json["name"].get<std::string>().size(), 600u);
  EXPECT_TRUE(std::all_of(line.begin(), line.end(), [](char c) { return c >= 0x20 && c < 0x7f; })) << line;
}

/// Returns a log line as printed on standard error by another process, so that this process's logger stays
/// unchanged.
std::string lineOnStandardError(LogFormat format, bool journal) {
  const test::TempFolder folder;
  const auto file = folder.write("stderr", "");
  const pid_t child = ::fork();
  if (child == 0) {
    const int fd = ::open(file.c_str(), O_WRONLY | O_APPEND);
    ::dup2(fd, STDERR_FILENO);
    struct stat info {};
    ::fstat(fd, &info);
    if (journal)
      ::setenv("JOURNAL_STREAM", (std::to_string(info.st_dev) + ":" + std::to_string(info.st_ino)).c_str(),
               1);
    setLogFormat(format);
    setLogLevel(LogLevel::kInfo);  // another test may have turned the log off
    logEvent(LogLevel::kWarning, "few_files", {{"limit", 200}});
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return *readWholeFile(file);
}

TEST(Log, theJournalHearsThePriority) {
  EXPECT_EQ(lineOnStandardError(LogFormat::kText, true), "<4>few_files limit=200\n");
  const std::string text = lineOnStandardError(LogFormat::kText, false);
  EXPECT_TRUE(text.starts_with("20") && text.ends_with(" warning few_files limit=200\n")) << text;
  const std::string json = lineOnStandardError(LogFormat::kJson, true);
  ASSERT_TRUE(json.starts_with("<4>{")) << json;
  const auto object = nlohmann::json::parse(json.substr(3), nullptr, false);
  ASSERT_TRUE(object.is_object()) << json;
  EXPECT_EQ(object["level"], "warning");
  EXPECT_EQ(object["limit"], 200);
  EXPECT_TRUE(object["time"].is_string());
  EXPECT_TRUE(lineOnStandardError(LogFormat::kJson, false).starts_with("{\"time\":\"20"));
}

TEST(LogBound, aMinutesLinesAreBoundedAndTheRestCountedOnce) {
  constexpr std::int64_t second_ns = 1'000'000'000;
  LogBound bound(3);
  EXPECT_EQ(bound.takeOmittedCount(0), 0u);
  std::uint64_t written = 0;
  for (std::int64_t s = 100; s < 160; ++s) {
    written += bound.take(s * second_ns);
    EXPECT_EQ(bound.takeOmittedCount(s * second_ns), 0u) << "the minute is not over";
  }
  EXPECT_EQ(written, 3u);
  EXPECT_EQ(bound.takeOmittedCount(160 * second_ns), 57u);
  EXPECT_EQ(bound.takeOmittedCount(160 * second_ns), 0u) << "once";
  // the next minute starts with its first line
  EXPECT_TRUE(bound.take(500 * second_ns));
  EXPECT_TRUE(bound.take(559 * second_ns));
  EXPECT_TRUE(bound.take(559 * second_ns));
  EXPECT_FALSE(bound.take(560 * second_ns - 1));
  EXPECT_TRUE(bound.take(560 * second_ns)) << "also if no one asked in between";
  EXPECT_EQ(bound.takeOmittedCount(560 * second_ns), 1u);
  EXPECT_EQ(bound.takeOmittedCount(INT64_MAX), 0u) << "nothing was left out of the last one";
}

TEST(LogBound, aPeriodEndsWhenItsNumberIsReported) {
  LogBound bound(1, 10);
  EXPECT_TRUE(bound.over(100));
  EXPECT_TRUE(bound.take(100));
  EXPECT_FALSE(bound.take(109));
  EXPECT_FALSE(bound.over(109));
  EXPECT_FALSE(bound.over(110)) << "one is still to be said";
  EXPECT_EQ(bound.takeOmittedCount(110), 1u);
  EXPECT_TRUE(bound.over(110));
}

TEST(Log, levelsHaveNames) {
  EXPECT_EQ(*parseLogLevel("warning"), LogLevel::kWarning);
  EXPECT_EQ(parseLogLevel("loud").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(*parseLogFormat("json"), LogFormat::kJson);
  EXPECT_EQ(parseLogFormat("xml").error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab
