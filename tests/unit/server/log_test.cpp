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
