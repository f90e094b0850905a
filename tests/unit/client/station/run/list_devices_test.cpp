#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "client/station/run/list_devices.h"
#include "client/station/run/report_output.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

DeviceLister lister(const std::string& spec, std::function<std::vector<FoundDevice>()> look) {
  return {spec, "a " + spec, std::move(look)};
}

TEST(ListDevices, keepsTheirOrderAndTakesSeveralOfAKind) {
  const auto list = listDevices({lister("one",
                                        [] {
                                          std::this_thread::sleep_for(20ms);
                                          return std::vector<FoundDevice>{{"one", "first", "fine", true}};
                                        }),
                                 lister("two",
                                        [] {
                                          return std::vector<FoundDevice>{{"two:a", "second", "needs", false},
                                                                          {"two:b", "third", "fine", true}};
                                        }),
                                 lister("none", [] { return std::vector<FoundDevice>{}; })},
                                10s);
  EXPECT_TRUE(list.all_answered);
  ASSERT_EQ(list.devices.size(), 3u);
  EXPECT_EQ(list.devices[0].spec, "one");
  EXPECT_EQ(list.devices[2].spec, "two:b");
}

TEST(ListDevices, aListerThatHangsOrThrowsIsSaidAndNotWaitedFor) {
  const auto from = std::chrono::steady_clock::now();
  const auto list =
      listDevices({lister("hangs",
                          [] {
                            std::this_thread::sleep_for(1500ms);
                            return std::vector<FoundDevice>{};
                          }),
                   lister("throws", []() -> std::vector<FoundDevice> { throw std::runtime_error("no bus"); }),
                   lister("works",
                          [] {
                            return std::vector<FoundDevice>{{"works", "device", "fine", true}};
                          })},
                  200ms);
  EXPECT_LT(std::chrono::steady_clock::now() - from, 1200ms);
  EXPECT_FALSE(list.all_answered);
  ASSERT_EQ(list.devices.size(), 3u);
  EXPECT_FALSE(list.devices[0].ready);
  EXPECT_THAT(list.devices[0].state, HasSubstr("no answer within 0.2 s"));
  EXPECT_THAT(list.devices[1].state, HasSubstr("no bus"));
  EXPECT_TRUE(list.devices[2].ready);
  std::this_thread::sleep_for(1600ms);  // its thread ends before the test's static objects
}

TEST(ListDevices, textAndRowsHoldEveryDevice) {
  const std::vector<FoundDevice> devices = {
      {"falcon", "Novint Falcon", std::string(150, 'x') + " end", false},
      {"bad\xff", "bytes", "that are no text", true}};
  const std::string text = deviceListText(devices);
  EXPECT_THAT(text, HasSubstr("falcon  NOT READY  Novint Falcon"));
  EXPECT_THAT(text, HasSubstr("ready"));
  const auto json = nlohmann::json::parse(deviceListJson(devices));
  ASSERT_EQ(json["rows"].size(), 2u);
  EXPECT_EQ(json["rows"][0]["device"], "falcon");
  EXPECT_EQ(json["rows"][0]["ready"], false);
}

TEST(ReportText, wrapsAtBlanksAndCountsCharactersNotBytes) {
  EXPECT_EQ(wrapped("ab cd ef", 2, 7), "  ab cd\n  ef\n");
  EXPECT_EQ(wrapped("abcdefghij k", 0, 4), "abcdefghij\nk\n");
  EXPECT_EQ(wrapped("", 3, 10), "");
  EXPECT_EQ(columnsOf("µs→"), 3u);
  EXPECT_EQ(padded("µ", 3), "µ  ");
}

}  // namespace
}  // namespace needlelab
