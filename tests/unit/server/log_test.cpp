#include "server/log.h"

#include <gtest/gtest.h>

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

TEST(Log, levelsHaveNames) {
  EXPECT_EQ(*parseLogLevel("warning"), LogLevel::kWarning);
  EXPECT_EQ(parseLogLevel("loud").error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab
