// A stranger who only reads: takes each sentence of the aid STEPS literally, presses the keys that it names,
// and knows nothing else. Written on the shoulder; the long form does it on the wrist, the knee and the
// lumbar spine, too.
#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <thread>

#include "common/base/program.h"
#include "tests/integration/lab.h"
#include "tests/support/run_form.h"
#include "tests/support/x_display.h"
#include "tests/windows/shown_frames.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

/// What a sentence asks for.
struct Order {
  bool hold = false;  ///< otherwise each key is pressed once, one after the other
  std::vector<std::string> keys;
  friend bool operator==(const Order&, const Order&) = default;
};

std::vector<std::string> splitAt(std::string text, const std::string& between) {
  std::vector<std::string> parts;
  for (std::size_t at = text.find(between); at != std::string::npos; at = text.find(between)) {
    parts.push_back(text.substr(0, at));
    text.erase(0, at + between.size());
  }
  parts.push_back(text);
  return parts;
}

/// "Hold Shift and W until …", "Press Esc, then Delete: …"
Order orderIn(const std::string& words) {
  static const std::regex hold("^.*?Step [123] of 3.*?Hold (.+?) until .*$"),
      press("^.*?Step [123] of 3.*?Press (.+?): .*$");
  std::smatch found;
  if (std::regex_match(words, found, hold)) return {true, splitAt(found[1], " and ")};
  if (std::regex_match(words, found, press)) return {false, splitAt(found[1], ", then ")};
  return {};
}

TEST(Order, isReadFromASentence) {
  EXPECT_EQ(
      orderIn("Shoulder 0:10 Step 2 of 3: Go in Shift W Hold Shift and W until the tip is in the bursa."),
      (Order{true, {"Shift", "W"}}));
  EXPECT_EQ(orderIn("Step 3 of 3: Done Esc Press Esc, then Delete: the lesson ends, and your score comes."),
            (Order{false, {"Esc", "Delete"}}));
  EXPECT_EQ(orderIn("Hold W until the tip is near."), Order{}) << "not a step";
}

class Reader : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!display_.isThere()) GTEST_SKIP() << "no Xvfb here: apt-get install xvfb xdotool";
    lab_.startServer();
  }
  /// All words that the window shows now.
  [[nodiscard]] std::string words() const {
    std::ifstream file(lab_.path("words.jsonl"));
    std::string newest, all;
    for (std::string line; std::getline(file, line);)
      if (!file.eof()) newest = line;
    const auto shown = nlohmann::json::parse(newest, nullptr, false);
    if (!shown.is_object()) return {};
    for (const auto& line : shown["words"]) all += line.get<std::string>() + " ";
    return all;
  }
  static std::string keyOf(const std::string& name) {
    static const std::map<std::string, std::string> names = {
        {"→", "Right"},    {"←", "Left"},      {"↑", "Up"},        {"↓", "Down"},
        {"Esc", "Escape"}, {"Shift", "shift"}, {"Space", "space"}, {"Delete", "Delete"}};
    const auto found = names.find(name);
    if (found != names.end()) return found->second;
    return std::string(1, static_cast<char>(std::tolower(name.front())));
  }
  void obey(const Order& order) {
    for (const std::string& name : held_.keys)
      if (!order.hold || std::ranges::find(order.keys, name) == order.keys.end()) display_.keyUp(keyOf(name));
    if (order.hold) {
      for (const std::string& name : order.keys)
        if (std::ranges::find(held_.keys, name) == held_.keys.end()) display_.keyDown(keyOf(name));
      held_ = order;
      return;
    }
    held_ = {};
    for (const std::string& name : order.keys) {
      display_.key(keyOf(name));
      std::this_thread::sleep_for(500ms);  // a person's fingers
    }
  }
  Lab lab_;
  XDisplay display_;
  Order held_;
};

TEST_P(Reader, passesTheFirstLesson) {
  auto arguments = lab_.stationArguments({"--exercise", GetParam(), "--start"});
  arguments.erase(std::ranges::find(arguments, "--headless"));
  arguments.insert(arguments.end(),
                   {"--window", "1280x720", "--json", lab_.path("window.json"), "--frame-log",
                    lab_.path("frames.csv"), "--text-log", lab_.path("words.jsonl")});
  Process station("needlelab-station", arguments, lab_.path("window.log"));
  const ShownFrames frames(lab_.path("frames.csv"), [&] { return station.wait(0ms).has_value(); });
  ASSERT_TRUE(frames.until([](const SeenFrame& frame) { return frame.lesson == 1 && frame.lesson_s > 0; }))
      << station.said();
  display_.moveTo(300, 400);
  ASSERT_TRUE(frames.sawInput()) << station.said();

  constexpr double kMost_s = 180;
  std::vector<std::string> heard;
  steady_clock::time_point pressed{};
  Order last;
  for (;;) {
    const auto frame = frames.newest();
    ASSERT_TRUE(frame && !station.wait(0ms)) << station.said();
    if (frame->screen == "end") break;
    ASSERT_LT(frame->lesson_s, kMost_s) << testing::PrintToString(heard) << words();
    const std::string now = words();
    const Order order = orderIn(now);
    const bool again = !order.hold && order == last && steady_clock::now() < pressed + 3s;
    if (!order.keys.empty() && !again && (!order.hold || order != held_)) {
      heard.push_back(now.substr(now.find("Step ")).substr(0, 90));
      obey(order);
      pressed = steady_clock::now();
    }
    last = order;
    std::this_thread::sleep_for(30ms);
  }
  obey({});
  station.signal(SIGTERM);
  ASSERT_EQ(station.wait(), kExitDone) << station.said();
  const auto row = lab_.summary("window")["rows"][0];
  int required = 0;
  for (const auto& measure : row["score"]) {
    if (!measure.contains("passed")) continue;
    ++required;
    EXPECT_TRUE(measure["passed"] == true) << measure["words"] << testing::PrintToString(heard);
  }
  EXPECT_GE(required, 8) << row.dump(1);
}

std::vector<const char*> bodies() {
  if (!longForm()) return {"shoulder-median"};
  return {"shoulder-median", "wrist-median", "knee-median", "lumbar-median"};
}

INSTANTIATE_TEST_SUITE_P(Bodies, Reader, testing::ValuesIn(bodies()), [](const auto& of) {
  std::string name = of.param;
  std::ranges::replace(name, '-', '_');
  return name;
});

}  // namespace
}  // namespace needlelab::test
