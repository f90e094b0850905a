#include "client/station/window/frame_log.h"

#include <gmock/gmock.h>

#include <sstream>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::string> linesOf(const std::filesystem::path& file) {
  const auto text = readWholeFile(file);
  EXPECT_TRUE(text.ok());
  std::istringstream all(text.ok() ? *text : std::string());
  std::vector<std::string> lines;
  for (std::string line; std::getline(all, line);) lines.push_back(line);
  return lines;
}

TEST(FrameLog, hasALineForEachFrameThatOthersReadAtOnce) {
  test::TempFolder folder;
  const auto file = folder.write("frames.csv", "of a run before\n");
  auto log = FrameLog::open(file);
  ASSERT_TRUE(log.ok()) << log.error().message;
  const std::string names =
      "frame,shown_ns,screen,question,can_begin,lesson,lesson_s,depth_m,plunger,p_WT_x_m,p_WT_y_m,p_WT_z_m,"
      "aim_WT_x_m,aim_WT_y_m,aim_WT_z_m";
  EXPECT_THAT(linesOf(file), ElementsAre(names));
  ASSERT_TRUE(log->add({Stage::kStart}, 1'000).ok());
  const std::string start = "1,1000,start,none,0,0,0,nan,nan,nan,nan,nan,nan,nan,nan";
  EXPECT_THAT(linesOf(file), ElementsAre(names, start));
  ShownFrame frame{Stage::kLesson, ShownQuestion::kEndLesson, true, 3, 1.5, -0.25, 0.5};
  frame.p_WT_m = {0.5, -1, 2};
  frame.aim_WT_m = {0.25, -2, 4};
  ASSERT_TRUE(log->add(frame, 9'007'199'254'740'993).ok());
  EXPECT_THAT(
      linesOf(file),
      ElementsAre(names, start, "2,9007199254740993,lesson,end-lesson,1,3,1.5,-0.25,0.5,0.5,-1,2,0.25,-2,4"));
}

TEST(FrameLog, namesEachScreenAndQuestion) {
  test::TempFolder folder;
  auto log = FrameLog::open(folder.path() / "frames.csv");
  ASSERT_TRUE(log.ok());
  const std::pair<Stage, const char*> screens[] = {
      {Stage::kOpening, "opening"}, {Stage::kStart, "start"},           {Stage::kPreparing, "preparing"},
      {Stage::kLesson, "lesson"},   {Stage::kConcluding, "concluding"}, {Stage::kEnd, "end"},
      {Stage::kClosing, "closing"}, {Stage::kFailed, "failed"}};
  const std::pair<ShownQuestion, const char*> questions[] = {{ShownQuestion::kNone, "none"},
                                                             {ShownQuestion::kEndLesson, "end-lesson"},
                                                             {ShownQuestion::kQuit, "quit"},
                                                             {ShownQuestion::kBeginExam, "begin-exam"}};
  for (const auto& [stage, screen] : screens)
    for (const auto& [question, asked] : questions) {
      ASSERT_TRUE(log->add({stage, question}, 0).ok());
      EXPECT_THAT(linesOf(folder.path() / "frames.csv").back(),
                  HasSubstr(std::string(",0,") + screen + "," + asked + ",0,"));
    }
}

TEST(FrameLog, aFileThatCannotBeWrittenIsNamedWithTheReason) {
  test::TempFolder folder;
  const auto nowhere = FrameLog::open(folder.path() / "no" / "frames.csv");
  ASSERT_FALSE(nowhere.ok());
  EXPECT_THAT(nowhere.error().message, HasSubstr((folder.path() / "no" / "frames.csv").string()));
  EXPECT_THAT(nowhere.error().message, HasSubstr("No such file or directory"));
  const auto full = FrameLog::open("/dev/full");
  ASSERT_FALSE(full.ok());
  EXPECT_THAT(full.error().message, HasSubstr("/dev/full"));
  EXPECT_THAT(full.error().message, HasSubstr("No space left on device"));
}

}  // namespace
}  // namespace needlelab
