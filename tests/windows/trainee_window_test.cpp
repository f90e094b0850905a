// The trainee's window as a person uses it: a display, a mouse, keys.
#include <gmock/gmock.h>
#include <signal.h>
#include <xcb/xcb.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>

#include "common/base/program.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"
#include "tests/support/x_display.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

struct Freed {
  void operator()(void* memory) const { std::free(memory); }
};
template <typename T>
using XReply = std::unique_ptr<T, Freed>;

/// Does what a window manager does when somebody presses its close button: sends WM_DELETE_WINDOW to the
/// window of this title. Returns false when there is no such window.
bool pressCloseButton(const XDisplay& display, std::string_view title) {
  const std::unique_ptr<xcb_connection_t, decltype(&xcb_disconnect)> connection(
      xcb_connect(display.name().c_str(), nullptr), &xcb_disconnect);
  xcb_connection_t* const x = connection.get();
  if (xcb_connection_has_error(x) != 0) return false;
  const auto atomOf = [x](std::string_view name) -> xcb_atom_t {
    const auto cookie = xcb_intern_atom(x, 0, static_cast<std::uint16_t>(name.size()), name.data());
    const XReply<xcb_intern_atom_reply_t> reply(xcb_intern_atom_reply(x, cookie, nullptr));
    return reply ? reply->atom : xcb_atom_t{XCB_ATOM_NONE};
  };
  const auto titleOf = [x](xcb_window_t window) -> std::string {
    const auto cookie = xcb_get_property(x, 0, window, XCB_ATOM_WM_NAME, XCB_GET_PROPERTY_TYPE_ANY, 0, 64);
    const XReply<xcb_get_property_reply_t> reply(xcb_get_property_reply(x, cookie, nullptr));
    if (!reply) return {};
    return {static_cast<const char*>(xcb_get_property_value(reply.get())),
            static_cast<std::size_t>(xcb_get_property_value_length(reply.get()))};
  };
  const xcb_window_t root = xcb_setup_roots_iterator(xcb_get_setup(x)).data->root;
  const XReply<xcb_query_tree_reply_t> tree(xcb_query_tree_reply(x, xcb_query_tree(x, root), nullptr));
  if (!tree) return false;
  const xcb_window_t* const windows = xcb_query_tree_children(tree.get());
  for (int i = 0; i < xcb_query_tree_children_length(tree.get()); ++i) {
    if (titleOf(windows[i]) != title) continue;
    xcb_client_message_event_t event{};
    event.response_type = XCB_CLIENT_MESSAGE;
    event.format = 32;
    event.window = windows[i];
    event.type = atomOf("WM_PROTOCOLS");
    event.data.data32[0] = atomOf("WM_DELETE_WINDOW");
    const auto sent = xcb_send_event_checked(x, 0, windows[i], XCB_EVENT_MASK_NO_EVENT,
                                             reinterpret_cast<const char*>(&event));
    return XReply<xcb_generic_error_t>(xcb_request_check(x, sent)) == nullptr;
  }
  return false;
}

class TraineeWindowTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!display_.isThere()) GTEST_SKIP() << "no Xvfb here: apt-get install xvfb xdotool";
  }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }
  void start(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--profile",       NEEDLELAB_SAMPLES "/shoulder-adult.json",
                                          "--spool",         path("spool"),
                                          "--json",          path("out.json"),
                                          "--window",        "1280x720",
                                          "--hand-tremor-m", "0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    station_ = std::make_unique<Process>("needlelab-station", arguments, path("log"));
  }
  bool says(const std::string& text) {
    eventually([&] { return has(text) || station_->wait(0ms); }, 60s);
    return has(text);
  }
  void pause(std::chrono::milliseconds time) { std::this_thread::sleep_for(time); }
  // The window is open and has the keyboard focus.
  void waitForWindow() {
    ASSERT_TRUE(eventually(
        [&] {
          return display_.tool({"search", "--name", kTitle}) == 0 || station_->wait(0ms);
        },
        60s))
        << station_->said();
    ASSERT_FALSE(station_->wait(0ms)) << "it ended: " << station_->said();
    display_.moveTo(300, 300);
    pause(2s);
  }
  [[nodiscard]] nlohmann::json summary() const {
    std::ifstream file(path("out.json"));
    return nlohmann::json::parse(file, nullptr, false);
  }
  [[nodiscard]] std::map<std::string, double> score() const {
    std::map<std::string, double> values;
    const auto out = summary();
    for (const auto& row : out["score"])
      if (row["value"].is_number()) values[row["measure"]] = row["value"];
    return values;
  }

  [[nodiscard]] bool has(const std::string& text) const {
    return station_->said().find(text) != std::string::npos;
  }

  static constexpr const char* kTitle = "needlelab station";
  TempFolder folder_;
  XDisplay display_;
  std::unique_ptr<Process> station_;
};

TEST_F(TraineeWindowTest, aLessonSteeredByMouseReachesTheTargetAndIsScored) {
  start({"--trainee", "tom"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow());
  display_.key("Return");  // Start: everything is given, one key starts the lesson
  ASSERT_TRUE(says("session ")) << station_->said();
  pause(2s);
  display_.key("3");  // from above: right is W's y
  // the hand waits 15 mm to the right of the entry and 30 mm above it; a pixel is 0.1 mm, a notch 1 mm
  display_.moveTo(500, 350);
  display_.drag(1, -150, 0);
  pause(1s);
  // 26 mm below the skin
  for (int i = 0; i < 8; ++i) {
    display_.wheel(7);
    pause(700ms);
  }
  pause(3s);
  display_.key("x", 900ms);  // draws back
  pause(500ms);
  display_.key("space", 3s);  // injects
  pause(500ms);
  for (int i = 0; i < 8; ++i) {
    display_.wheel(-7);
    pause(300ms);
  }
  pause(1s);
  display_.key("Escape");
  display_.key("Return");
  ASSERT_TRUE(says("score  ")) << station_->said();
  station_->signal(SIGTERM);
  ASSERT_TRUE(station_->wait(60s)) << station_->said();

  const auto values = score();
  ASSERT_TRUE(values.contains("target_reached")) << station_->said();
  EXPECT_EQ(values.at("target_reached"), 1) << station_->said();
  EXPECT_GT(values.at("time_at_target_s"), 1);
  EXPECT_EQ(values.at("hazards_touched"), 0);
  EXPECT_GE(values.at("entries"), 1);  // a busy machine moves the steered hand in jumps
  EXPECT_GT(values.at("peak_force_n"), 1) << "tissue resists";
  const auto syringe = summary()["syringe"];
  std::vector<std::string>
      events;  // a window that stalls lets the plunger rest: then one stroke is two events
  for (const auto& each : syringe)
    if (events.empty() || events.back() != each["event"]) events.push_back(each["event"]);
  EXPECT_EQ(events, (std::vector<std::string>{"ASPIRATION", "INJECTION"})) << syringe;
  EXPECT_EQ(summary()["stopped_by"], "tom");
  EXPECT_EQ(summary()["fault"], nullptr);
}

TEST_F(TraineeWindowTest, keysAloneSuffice) {
  start({"--trainee", "tom", "--start"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow());
  ASSERT_TRUE(says("session ")) << station_->said();
  pause(2s);
  display_.key("3");
  display_.key("w", 2s);  // 12 mm/s
  display_.key("Left", 700ms);
  pause(1s);
  display_.key("Escape");
  display_.key("Escape");  // not yet
  pause(500ms);
  display_.key("Escape");
  display_.key("Return");
  ASSERT_TRUE(says("score  ")) << station_->said();
  // Once more, by one key. It is pressed again until the End screen appears (in a lesson it does nothing).
  ASSERT_TRUE(eventually(
      [&] {
        const std::string said = station_->said();
        if (said.rfind("real time: ") > said.find("score  ")) return true;
        display_.key("Return");
        pause(500ms);
        return false;
      },
      60s))
      << station_->said();
  pause(1s);
  station_->signal(SIGTERM);
  ASSERT_EQ(station_->wait(60s), kExitDone) << station_->said();
  ASSERT_EQ(summary()["rows"].size(), 2u);
  // two seconds of W and more than half a second of Left are in the recording
  EXPECT_GT(summary()["rows"][0]["score"][0]["value"], 3.0);
}

TEST_F(TraineeWindowTest, theCloseButtonAsksAndThenEndsTheLessonAndKeepsIt) {
  start({"--trainee", "tom", "--start"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow());
  ASSERT_TRUE(says("real time: ")) << station_->said();  // the loop runs
  ASSERT_TRUE(pressCloseButton(display_, kTitle));
  pause(2s);
  ASSERT_FALSE(station_->wait(0ms)) << "it asks first: " << station_->said();
  // The answer is given again until the question is drawn (without it the key does nothing in a lesson).
  ASSERT_TRUE(eventually(
      [&] {
        if (!station_->wait(0ms)) display_.key("Return");
        return station_->wait(1s).has_value();
      },
      60s))
      << station_->said();
  EXPECT_EQ(station_->wait(0ms), kExitDone) << station_->said();
  const auto out = summary();
  EXPECT_GT(out["samples"], 0) << station_->said();
  EXPECT_EQ(out["fault"], nullptr);
  EXPECT_EQ(out["samples_lost"], 0);
}

TEST_F(TraineeWindowTest, aWindowThatIsDestroyedEndsTheLessonAndKeepsIt) {
  start({"--trainee", "tom", "--start"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow());
  ASSERT_TRUE(says("real time: ")) << station_->said();        // the loop runs
  display_.tool({"search", "--name", kTitle, "windowclose"});  // XDestroyWindow
  ASSERT_TRUE(station_->wait(60s)) << station_->said();
  const auto out = summary();
  EXPECT_GT(out["samples"], 0) << station_->said();
  EXPECT_EQ(out["fault"], nullptr);
  EXPECT_EQ(out["samples_lost"], 0);
}

TEST_F(TraineeWindowTest, aDisplayThatGoesEndsTheLessonAndKeepsIt) {
  start({"--trainee", "tom", "--start"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow());
  ASSERT_TRUE(says("real time: ")) << station_->said();  // the loop runs
  display_.end();
  ASSERT_TRUE(station_->wait(60s)) << station_->said();
  EXPECT_THAT(station_->said(), HasSubstr("the display is gone"));
  const auto out = summary();
  EXPECT_GT(out["samples"], 0) << station_->said();
  EXPECT_EQ(out["fault"], nullptr);
}

TEST(TraineeWithoutADisplay, isToldWhatElseThereIs) {
  TempFolder folder;
  ::unsetenv("DISPLAY");
  Process station("needlelab-station",
                  {"--profile", NEEDLELAB_SAMPLES "/shoulder-adult.json", "--spool", folder.path() / "spool"},
                  folder.path() / "log");
  EXPECT_EQ(station.wait(60s), kExitFailed);
  EXPECT_THAT(station.said(), HasSubstr("--headless"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "spool")) << "nothing was begun";
}

TEST(TraineeWithoutADisplay, picturesAreTakenOfALessonThatEndsByItself) {
  TempFolder folder;
  ::unsetenv("DISPLAY");
  Process station("needlelab-station", {"--profile",    NEEDLELAB_SAMPLES "/shoulder-adult.json",
                                        "--spool",      folder.path() / "spool",
                                        "--seconds",    "3",
                                        "--screenshot", folder.path() / "start.png",
                                        "--at",         "start",
                                        "--screenshot", folder.path() / "lesson.png",
                                        "--at",         "1.5",
                                        "--screenshot", folder.path() / "end.png",
                                        "--at",         "end",
                                        "--window",     "1280x720"},
                  folder.path() / "log");
  EXPECT_EQ(station.wait(120s), kExitDone) << station.said();
  for (const char* name : {"start.png", "lesson.png", "end.png"})
    EXPECT_GT(std::filesystem::file_size(folder.path() / name), 10'000u) << name;
}

}  // namespace
}  // namespace needlelab::test
