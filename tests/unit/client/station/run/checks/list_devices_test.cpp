#include <gmock/gmock.h>

#include <future>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "client/station/run/checks/list_devices.h"
#include "client/station/run/io/terminal.h"
#include "tests/support/time/fake_time.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

DeviceLister lister(const std::string& spec, std::function<std::vector<FoundDevice>()> look) {
  return {spec, "a " + spec, std::move(look)};
}

TEST(ListDevices, keepsTheirOrderAndTakesSeveralOfAKind) {
  std::promise<void> last;
  const auto list = listDevices({lister("one",
                                        [&] {
                                          last.get_future().wait();
                                          return std::vector<FoundDevice>{{"one", "first", "fine", true}};
                                        }),
                                 lister("two",
                                        [] {
                                          return std::vector<FoundDevice>{{"two:a", "second", "needs", false},
                                                                          {"two:b", "third", "fine", true}};
                                        }),
                                 lister("none",
                                        [&] {
                                          last.set_value();
                                          return std::vector<FoundDevice>{};
                                        })},
                                1h);
  EXPECT_TRUE(list.all_answered);
  ASSERT_EQ(list.devices.size(), 3u);
  EXPECT_EQ(list.devices[0].spec, "one");
  EXPECT_EQ(list.devices[2].spec, "two:b");
}

// Time stands still until only one search is left; then the patience ends at once.
class TimeOfTheLast : public test::FakeTime {
 public:
  using FakeTime::FakeTime, FakeTime::waitUntilNs;
  void waitUntilNs(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                   std::int64_t due_ns) override {
    if (searches.use_count() > 3) {  // ours and those of the listers
      lock.unlock();
      std::this_thread::yield();
      lock.lock();
    } else {
      FakeTime::waitUntilNs(changed, lock, due_ns);
    }
  }
  // each of the other searches holds it until it has answered
  std::shared_ptr<int> searches = std::make_shared<int>();
};

TEST(ListDevices, aHangingOrThrowingListerIsReportedWithoutWaiting) {
  TimeOfTheLast time;
  std::promise<void> end;
  const auto running = std::make_shared<int>();
  const std::int64_t began_ns = time.nowNs();
  std::vector<DeviceLister> listers = {
      lister("hangs",
             [gate = end.get_future().share(), running] { return gate.wait(), std::vector<FoundDevice>{}; }),
      lister("throws",
             [held = time.searches]() -> std::vector<FoundDevice> { throw std::runtime_error("no bus"); }),
      lister("works", [held = time.searches] {
        return std::vector<FoundDevice>{{"works", "device", "fine", true}};
      })};
  const auto list = listDevices(listers, 200ms, time);
  EXPECT_EQ(time.nowNs() - began_ns, 200'000'000);
  EXPECT_FALSE(list.all_answered);
  ASSERT_EQ(list.devices.size(), 3u);
  EXPECT_FALSE(list.devices[0].ready);
  EXPECT_THAT(list.devices[0].state, HasSubstr("no answer within 0.2 s"));
  EXPECT_THAT(list.devices[1].state, HasSubstr("no bus"));
  EXPECT_TRUE(list.devices[2].ready);
  end.set_value();
  listers.clear();
  while (running.use_count() > 1) std::this_thread::yield();  // the test's objects must outlive its thread
}

TEST(ListDevices, textAndRowsHoldEveryDevice) {
  const std::vector<FoundDevice> devices = {
      {"falcon", "Novint Falcon", std::string(150, 'x') + " end", false},
      {"bad\xff", "bytes", "that are not text", true}};
  const std::string text = deviceListText(devices);
  EXPECT_THAT(text, HasSubstr("falcon  NOT READY  Novint Falcon"));
  EXPECT_THAT(text, HasSubstr("ready"));
  const auto json = nlohmann::json::parse(deviceListJson(devices));
  ASSERT_EQ(json["rows"].size(), 2u);
  EXPECT_EQ(json["rows"][0]["device"], "falcon");
  EXPECT_EQ(json["rows"][0]["ready"], false);
}

}  // namespace
}  // namespace needlelab
