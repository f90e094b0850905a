#include "instructor/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace needlelab {
namespace {

constexpr const char* kSession = "019aa0c3-7c1e-7b3a-9d5e-0123456789ab";

InstructorOptions good() {
  InstructorOptions options;
  options.server = "127.0.0.1:7750";
  options.ca = "ca.crt";
  options.user = "anna";
  return options;
}

TEST(InstructorOptions, whatMakesSensePasses) {
  EXPECT_TRUE(checkOptions(good()).ok());
  auto options = good();
  options.session = kSession;
  options.replay = true;
  options.rate_hz = 0;
  options.seconds = 3.5;
  options.speed = 0;
  EXPECT_TRUE(checkOptions(options).ok());
  EXPECT_EQ(sessionBytes(options).size(), 16u);
  EXPECT_EQ(sessionBytes(options)[1], '\x9a');
}

TEST(InstructorOptions, whatDoesNotIsRefusedByName) {
  const std::pair<const char*, std::function<void(InstructorOptions&)>> cases[] = {
      {"--server", [](auto& o) { o.server = "host:port"; }},
      {"--session", [](auto& o) { o.session = "17"; }},
      {"--station", [](auto& o) { o.session = kSession, o.station = "bench-1"; }},
      {"--replay", [](auto& o) { o.replay = true; }},
      {"--message", [](auto& o) { o.message = "hello"; }},
      {"--rate", [](auto& o) { o.rate_hz = -1; }},
      {"--rate", [](auto& o) { o.rate_hz = std::nan(""); }},
      {"--seconds", [](auto& o) { o.seconds = -2; }},
      {"--speed", [](auto& o) { o.speed = 1e9; }},
  };
  for (const auto& [name, spoil] : cases) {
    auto options = good();
    spoil(options);
    const auto status = checkOptions(options);
    ASSERT_FALSE(status.ok()) << name;
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(status.error().message, testing::HasSubstr(name));
  }
}

}  // namespace
}  // namespace needlelab
