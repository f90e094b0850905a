#include "client/instructor/terminal/options.h"

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
  options.headless = true;
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
  auto speaker = good();
  speaker.station = "bench-1";
  speaker.message = "well done";
  speaker.once = true;
  EXPECT_TRUE(checkOptions(speaker).ok());
  EXPECT_EQ(sessionBytes(options).size(), 16u);
  EXPECT_EQ(sessionBytes(options)[1], '\x9a');
}

TEST(InstructorOptions, theWindowAsksForMissingOptions) {
  EXPECT_TRUE(checkOptions(InstructorOptions{}).ok());
  EXPECT_TRUE(InstructorOptions{}.window());
  InstructorOptions sized;
  sized.window_size = "1600x900";
  EXPECT_EQ(windowSizeOf(sized)->width_px, 1600);
  EXPECT_EQ(windowSizeOf(sized)->height_px, 900);
  auto options = good();
  options.headless = true;
  EXPECT_FALSE(options.window());
  options = good();
  options.headless = false;
  options.report = "a.html";
  options.session = kSession;
  EXPECT_FALSE(options.window());
  EXPECT_TRUE(checkOptions(options).ok());
}

TEST(InstructorOptions, whatDoesNotIsRefusedByName) {
  const std::pair<const char*, std::function<void(InstructorOptions&)>> cases[] = {
      {"--server", [](auto& o) { o.server = "host:port"; }},
      {"--server", [](auto& o) { o.server = "lab,lab"; }},
      {"--session", [](auto& o) { o.session = "17"; }},
      {"--station", [](auto& o) { o.session = kSession, o.station = "bench-1"; }},
      {"--replay", [](auto& o) { o.replay = true; }},
      {"--message", [](auto& o) { o.message = "hello"; }},
      {"--once", [](auto& o) { o.once = true, o.station = "bench-1"; }},
      {"--rate", [](auto& o) { o.rate_hz = -1; }},
      {"--rate", [](auto& o) { o.rate_hz = std::nan(""); }},
      {"--seconds", [](auto& o) { o.seconds = -2; }},
      {"--speed", [](auto& o) { o.speed = 1e9; }},
      {"--server", [](auto& o) { o.server.clear(), o.headless = true; }},
      {"--ca", [](auto& o) { o.ca.clear(), o.headless = true; }},
      {"--user",
       [](auto& o) { o.user.clear(), o.report = "a.html", o.session = kSession, o.headless = false; }},
      {"--report", [](auto& o) { o.report = "a.html"; }},
      {"--screenshot", [](auto& o) { o.screenshot = "a.png", o.headless = true; }},
      {"--at", [](auto& o) { o.screenshot = "a.png", o.at_s = -1, o.headless = false; }},
      {"--headless", [](auto& o) { o.station = "bench-1", o.message = "hello", o.headless = false; }},
      {"--font-scale", [](auto& o) { o.font_scale = 9; }},
      {"--window", [](auto& o) { o.window_size = "1x1"; }},
      {"--window", [](auto& o) { o.window_size = "1280"; }},
      {"--window", [](auto& o) { o.window_size = "1280x720x"; }},
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
