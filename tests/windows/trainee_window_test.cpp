// The trainee's window as a person uses it: a display, a mouse, keys.
#include <gmock/gmock.h>
#include <signal.h>
#include <xcb/xcb.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "common/base/program.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"
#include "tests/support/x_display.h"
#include "tests/windows/shown_frames.h"

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
                                          "--frame-log",     path("frames.csv"),
                                          "--hand-tremor-m", "0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    station_ = std::make_unique<Process>("needlelab-station", arguments, path("log"));
  }
  bool says(const std::string& text) {
    eventually([&] { return has(text) || station_->wait(0ms); }, 60s);
    return has(text);
  }
  // The window shows this screen, the mouse is in it, and it has the keyboard.
  void waitForWindow(const std::string& screen) {
    ASSERT_TRUE(frames_.untilScreen(screen)) << station_->said();
    display_.moveTo(300, 300);
    ASSERT_TRUE(frames_.sawInput()) << station_->said();
  }
  // The window has shown a sample of the first lesson that is as late as this.
  void waitForLesson(double lesson_s = 0) {
    ASSERT_TRUE(frames_.until([&](const SeenFrame& frame) {
      return frame.screen == "lesson" && !std::isnan(frame.depth_m) && frame.lesson_s >= lesson_s;
    })) << station_->said();
  }
  // The tip has come within `m` of where mouse and keys want it.
  void waitForTip(double m) {
    ASSERT_TRUE(frames_.sawInput()) << station_->said();
    ASSERT_TRUE(frames_.until([&](const SeenFrame& frame) { return frame.behind_m() < m; }))
        << station_->said();
  }
  // Turns the wheel by one millimetre a notch and lets the tip follow.
  void advance(int notches, double within_m) {
    const auto before = frames_.newest();
    ASSERT_TRUE(before);
    display_.wheel(notches);
    ASSERT_TRUE(frames_.until([&](const SeenFrame& frame) {
      return norm(frame.aim_WT_m - before->aim_WT_m) > 1e-3 * (std::abs(notches) - 0.5);
    })) << "the window has not seen all notches: "
        << station_->said();
    waitForTip(within_m);
  }
  void holdKey(const std::string& name, const std::function<bool(const SeenFrame&)>& until) {
    display_.keyDown(name);
    const bool reached = frames_.until(until);
    display_.keyUp(name);
    ASSERT_TRUE(reached) << name << ": " << station_->said();
    ASSERT_TRUE(frames_.sawInput()) << station_->said();
  }
  [[nodiscard]] nlohmann::json summary() const {
    std::ifstream file(path("out.json"));
    return nlohmann::json::parse(file, nullptr, false);
  }
  static std::map<std::string, double> scoreOf(const nlohmann::json& lesson) {
    std::map<std::string, double> values;
    for (const auto& row : lesson["score"])
      if (row["value"].is_number()) values[row["measure"]] = row["value"];
    return values;
  }
  // The recording has all ticks up to the last sample that the window has shown, but for missed ones.
  void expectAllThatWasShown(const nlohmann::json& out) {
    const auto last = frames_.newest();
    ASSERT_TRUE(last);
    EXPECT_GE(out["samples"].get<double>() + out["missed_ticks"].get<double>(),
              std::round(1000 * last->lesson_s))
        << station_->said();
    EXPECT_EQ(out["samples_lost"], 0);
  }

  [[nodiscard]] bool has(const std::string& text) const {
    return station_->said().find(text) != std::string::npos;
  }

  static constexpr const char* kTitle = "needlelab station";
  TempFolder folder_;
  XDisplay display_;
  std::unique_ptr<Process> station_;
  ShownFrames frames_{path("frames.csv"), [this] { return station_->wait(0ms).has_value(); }};
};

TEST_F(TraineeWindowTest, aLessonSteeredByMouseReachesTheTargetAndIsScored) {
  start({"--trainee", "tom"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow("start"));
  ASSERT_TRUE(frames_.until([](const SeenFrame& frame) { return frame.can_begin; })) << station_->said();
  display_.key("Return");  // Start: everything is given, one key starts the lesson
  ASSERT_NO_FATAL_FAILURE(waitForLesson());
  display_.key("3");  // from above: right is W's y
  display_.moveTo(500, 350);
  ASSERT_TRUE(frames_.sawInput()) << station_->said();
  // the hand waits 30 mm above the entry; a pixel is 0.1 mm, a notch 1 mm
  const auto waiting = frames_.newest();
  ASSERT_TRUE(waiting);
  display_.buttonDown(1);
  ASSERT_TRUE(frames_.sawInput()) << station_->said();
  display_.moveBy(-150, 0);
  ASSERT_TRUE(frames_.sawInput()) << station_->said();
  display_.buttonUp(1);
  ASSERT_NO_FATAL_FAILURE(waitForTip(0.5e-3));
  const Vec3 dragged_m = frames_.newest()->aim_WT_m - waiting->aim_WT_m;
  EXPECT_NEAR(norm(dragged_m), 0.015, 1e-4);
  EXPECT_LT(dragged_m.y, -0.014);
  display_.key("l");  // lines up again
  ASSERT_TRUE(frames_.until([&](const SeenFrame& frame) {
    return norm(frame.aim_WT_m - waiting->aim_WT_m) < 1e-4 && frame.behind_m() < 0.5e-3;
  })) << station_->said();
  // 26 mm below the skin. The aim never rests near the skin, where the tip could swing in and out.
  for (const int notches : {13, 13, 12, 5, 5, 4, 4}) ASSERT_NO_FATAL_FAILURE(advance(notches, 0.5e-3));
  const double there_s = frames_.newest()->lesson_s;
  ASSERT_NO_FATAL_FAILURE(waitForLesson(there_s + 1.5));
  ASSERT_NO_FATAL_FAILURE(  // draws back
      holdKey("x", [](const SeenFrame& frame) { return frame.plunger < 0.005; }));
  ASSERT_NO_FATAL_FAILURE(  // injects
      holdKey("space", [](const SeenFrame& frame) { return frame.plunger > 0.9; }));
  for (const int notches : {-18, -18}) ASSERT_NO_FATAL_FAILURE(advance(notches, 1e-3));
  EXPECT_LT(frames_.newest()->depth_m, -8e-3) << "outside";
  display_.key("Escape");
  ASSERT_TRUE(frames_.untilQuestion("end-lesson")) << station_->said();
  display_.key("Delete");
  ASSERT_TRUE(says("score  ")) << station_->said();
  station_->signal(SIGTERM);
  ASSERT_TRUE(station_->wait()) << station_->said();

  const auto values = scoreOf(summary());
  ASSERT_TRUE(values.contains("target_reached")) << station_->said();
  EXPECT_EQ(values.at("target_reached"), 1) << station_->said();
  EXPECT_GT(values.at("time_at_target_s"), 1);
  EXPECT_EQ(values.at("hazards_touched"), 0);
  EXPECT_EQ(values.at("entries"), 1);
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
  ASSERT_NO_FATAL_FAILURE(waitForWindow("lesson"));
  ASSERT_NO_FATAL_FAILURE(waitForLesson());
  display_.key("3");
  ASSERT_TRUE(frames_.sawInput()) << station_->said();
  const auto waiting = frames_.newest();
  ASSERT_TRUE(waiting);
  // 20 mm in, of 30 mm to the skin, and 10 mm to the left
  ASSERT_NO_FATAL_FAILURE(
      holdKey("w", [&](const SeenFrame& frame) { return norm(frame.aim_WT_m - waiting->aim_WT_m) > 0.02; }));
  const auto in = frames_.newest();
  ASSERT_TRUE(in);
  ASSERT_NO_FATAL_FAILURE(
      holdKey("Left", [&](const SeenFrame& frame) { return norm(frame.aim_WT_m - in->aim_WT_m) > 0.01; }));
  ASSERT_NO_FATAL_FAILURE(waitForTip(0.5e-3));
  EXPECT_GT(norm(frames_.newest()->p_WT_m - waiting->p_WT_m), std::hypot(0.02, 0.01) - 1e-3);
  for (const char* const question : {"end-lesson", "none", "end-lesson"}) {
    display_.key("Escape");
    ASSERT_TRUE(frames_.untilQuestion(question)) << station_->said();
  }
  const double shown_s = frames_.newest()->lesson_s;
  display_.key("Delete");
  ASSERT_TRUE(says("score  ")) << station_->said();
  // once more, by one key
  ASSERT_TRUE(frames_.until([](const SeenFrame& frame) { return frame.screen == "end" && frame.can_begin; }))
      << station_->said();
  display_.key("Return");
  ASSERT_TRUE(frames_.until([](const SeenFrame& frame) {
    return frame.screen == "lesson" && frame.lesson == 2 && frame.lesson_s > 0;
  })) << station_->said();
  station_->signal(SIGTERM);
  ASSERT_EQ(station_->wait(), kExitDone) << station_->said();
  ASSERT_EQ(summary()["rows"].size(), 2u);
  EXPECT_GE(scoreOf(summary()["rows"][0]).at("elapsed_s"), shown_s);
}

/// A layout, and the key on which a person finds W: its label, or its number on an Arabic keyboard, whose W
/// has an Arabic letter and, on most, a Latin one beside it.
struct Layout {
  std::vector<std::string> name;
  std::string w;
};

class TraineeKeyboard : public TraineeWindowTest, public testing::WithParamInterface<Layout> {};

TEST_P(TraineeKeyboard, theKeyLabelledWGoesIn) {
  ASSERT_TRUE(display_.layout(GetParam().name));
  start({"--trainee", "tom", "--start", "--uncapped"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow("lesson"));
  ASSERT_NO_FATAL_FAILURE(waitForLesson());
  const auto waiting = frames_.newest();
  ASSERT_TRUE(waiting);
  if (GetParam().name.front() == "fr") {  // the place of a US keyboard's W has a Z
    display_.keyDown("z");
    ASSERT_TRUE(frames_.sawInput()) << station_->said();
    ASSERT_NO_FATAL_FAILURE(waitForLesson(frames_.newest()->lesson_s + 0.5));
    display_.keyUp("z");
    EXPECT_EQ(norm(frames_.newest()->aim_WT_m - waiting->aim_WT_m), 0);
  }
  ASSERT_NO_FATAL_FAILURE(holdKey(GetParam().w, [&](const SeenFrame& frame) {
    return norm(frame.aim_WT_m - waiting->aim_WT_m) > 0.005 && frame.depth_m > waiting->depth_m;
  }));
  station_->signal(SIGTERM);
  EXPECT_EQ(station_->wait(), kExitDone) << station_->said();
}

INSTANTIATE_TEST_SUITE_P(Layouts, TraineeKeyboard,
                         testing::Values(Layout{{"fr"}, "w"}, Layout{{"ara"}, "25"}),
                         [](const auto& of) { return of.param.name.back(); });

TEST_F(TraineeWindowTest, theCloseButtonAsksAndThenEndsTheLessonAndKeepsIt) {
  start({"--trainee", "tom", "--start"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow("lesson"));
  ASSERT_NO_FATAL_FAILURE(waitForLesson(0.5));
  ASSERT_TRUE(pressCloseButton(display_, kTitle));
  ASSERT_TRUE(frames_.untilQuestion("quit")) << station_->said();
  ASSERT_TRUE(frames_.sawInput()) << "it asks first, and the lesson goes on: " << station_->said();
  EXPECT_EQ(frames_.newest()->screen, "lesson");
  display_.key("Return");
  ASSERT_TRUE(frames_.untilQuestion("none")) << station_->said();
  ASSERT_TRUE(pressCloseButton(display_, kTitle));
  ASSERT_TRUE(frames_.untilQuestion("quit")) << "Enter stays: " << station_->said();
  display_.key("Delete");
  ASSERT_EQ(station_->wait(), kExitDone) << station_->said();
  const auto out = summary();
  EXPECT_EQ(out["fault"], nullptr);
  expectAllThatWasShown(out);
}

TEST_F(TraineeWindowTest, aWindowThatIsDestroyedEndsTheLessonAndKeepsIt) {
  start({"--trainee", "tom", "--start"});
  ASSERT_NO_FATAL_FAILURE(waitForWindow("lesson"));
  ASSERT_NO_FATAL_FAILURE(waitForLesson(0.5));
  display_.tool({"search", "--name", kTitle, "windowclose"});  // XDestroyWindow
  ASSERT_TRUE(station_->wait()) << station_->said();
  const auto out = summary();
  EXPECT_EQ(out["fault"], nullptr);
  expectAllThatWasShown(out);
}

// width and height, as PNG keeps them
std::pair<unsigned, unsigned> sizeOfPicture(const std::filesystem::path& png) {
  std::ifstream file(png, std::ios::binary);
  unsigned char head[24] = {};
  file.read(reinterpret_cast<char*>(head), sizeof head);
  const auto number = [&](int at) {
    return static_cast<unsigned>(head[at]) << 24 | static_cast<unsigned>(head[at + 1]) << 16 |
           static_cast<unsigned>(head[at + 2]) << 8 | static_cast<unsigned>(head[at + 3]);
  };
  return {number(16), number(20)};
}

TEST(TraineeOnAScreen, takesAllOfItUnlessItIsForADesk) {
  XDisplay display(1440, 900);
  if (!display.isThere()) GTEST_SKIP() << "no Xvfb here: apt-get install xvfb xdotool";
  for (const auto& [option, size] :
       {std::pair("--no-quit", std::pair(1440U, 900U)), std::pair("--windowed", std::pair(1280U, 720U))}) {
    TempFolder folder;
    ::setenv("XDG_STATE_HOME", folder.path().c_str(), 1);  // no window was left there yet
    const auto picture = folder.path() / "start.png";
    Process station("needlelab-station",
                    {"--profile", NEEDLELAB_SAMPLES "/shoulder-adult.json", "--spool",
                     folder.path() / "spool", "--screenshot", picture, "--at", "start", option},
                    folder.path() / "log");
    EXPECT_TRUE(eventually([&] { return std::filesystem::exists(picture) || station.wait(0ms); }, 60s));
    EXPECT_EQ(sizeOfPicture(picture), size) << option << ": " << station.said();
    station.signal(SIGTERM);
    EXPECT_EQ(station.wait(), kExitDone) << station.said();
    ::unsetenv("XDG_STATE_HOME");
  }
}

TEST(TraineeWithoutADisplay, isToldTheAlternatives) {
  TempFolder folder;
  ::unsetenv("DISPLAY");
  Process station("needlelab-station",
                  {"--profile", NEEDLELAB_SAMPLES "/shoulder-adult.json", "--spool", folder.path() / "spool"},
                  folder.path() / "log");
  EXPECT_EQ(station.wait(), kExitFailed);
  EXPECT_THAT(station.said(), HasSubstr("--headless"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "spool")) << "nothing was begun";
}

TEST(TraineeWithoutADisplay, picturesAreTakenOfALessonThatEndsByItself) {
  TempFolder folder;
  ::unsetenv("DISPLAY");
  Process station("needlelab-station", {"--profile",    NEEDLELAB_SAMPLES "/shoulder-adult.json",
                                        "--spool",      folder.path() / "spool",
                                        "--seconds",    "6",
                                        "--screenshot", folder.path() / "start.png",
                                        "--at",         "start",
                                        "--screenshot", folder.path() / "lesson.png",
                                        "--at",         "0.5",
                                        "--screenshot", folder.path() / "end.png",
                                        "--at",         "end",
                                        "--window",     "1280x720"},
                  folder.path() / "log");
  EXPECT_EQ(station.wait(), kExitDone) << station.said();
  for (const char* name : {"start.png", "lesson.png", "end.png"})
    EXPECT_GT(std::filesystem::file_size(folder.path() / name), 10'000u) << name;
}

}  // namespace
}  // namespace needlelab::test
