#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "client/device/pose_option.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

const Pose kPose{{0.1, -2.5e-3, 1.0 / 3}, {0.5, -0.5, 0.5, -0.5}};

std::string messageOf(const std::string& text) {
  const auto pose = parsePoseOption(text, "--tool");
  if (pose.ok()) return "accepted";
  EXPECT_EQ(pose.error().code, ErrorCode::kInvalidInput);
  return pose.error().message;
}

// Returns the error message for a file with this content.
std::string messageOfFile(const std::string& content) {
  const auto path = std::filesystem::temp_directory_path() / "needlelab_pose_option_test.json";
  std::ofstream(path) << content;
  const std::string message = messageOf(path.string());
  std::filesystem::remove(path);
  return message;
}

TEST(PoseOption, survivesARoundTrip) {
  EXPECT_EQ(*parsePoseOption(poseOptionText(kPose), "--tool"), kPose);
  const auto path = std::filesystem::temp_directory_path() / "needlelab,pose_option.json";
  std::ofstream(path) << poseOptionJson(kPose);
  const auto from_file = parsePoseOption(path.string(), "--tool");
  std::filesystem::remove(path);
  ASSERT_TRUE(from_file.ok()) << from_file.error().message;
  EXPECT_EQ(*from_file, kPose);
}

TEST(PoseOption, normalisesASlightlyLongQuaternion) {
  const auto pose = parsePoseOption("0, 0, 0.15, 0, 0, 0, 1.0005", "--tool");
  ASSERT_TRUE(pose.ok());
  EXPECT_EQ(pose->q, (Quat{0, 0, 0, 1}));
}

TEST(PoseOption, takesSignsOfPagesAndSpreadsheets) {
  EXPECT_EQ(parsePoseOption("0,+0.01,\u22120.15,0,0,0,1", "--tool")->p, (Vec3{0, 0.01, -0.15}));
}

TEST(PoseOption, refusesWrongNumbersByName) {
  EXPECT_THAT(messageOf("0,0,0.1"), HasSubstr("--tool: 3 numbers"));
  EXPECT_THAT(messageOf("0,0,0,0,0,0,1,0"), HasSubstr("8 numbers"));
  EXPECT_THAT(messageOf("0,0,,0,0,0,1"), HasSubstr("'' is not a number"));
  EXPECT_THAT(messageOf("0,0,1e,0,0,0,1"), HasSubstr("'1e' is not a number"));
  EXPECT_THAT(messageOf("0,0,0,0,0,0,0.9"), HasSubstr("length of the quaternion: 0.9"));
  EXPECT_THAT(messageOf("0,2000,0,0,0,0,1"), HasSubstr("--tool: the distance from the origin is 2000 m"));
  EXPECT_THAT(messageOf("0,0,130,0,0,0,1"), HasSubstr("looks like millimetres: 130 millimetres are 0.13 m"));
  EXPECT_THAT(parsePoseOption("0,0,-20,0,0,0,1", "--placement", Quantity::kPlacement).error().message,
              HasSubstr("--placement: the distance from the origin is 20 m"));
  EXPECT_THAT(messageOf(""), HasSubstr("--tool"));
  EXPECT_THAT(messageOf("/nowhere/tool.json"), HasSubstr("/nowhere/tool.json"));
}

TEST(PoseOption, refusesWrongFilesByField) {
  EXPECT_THAT(messageOfFile("x"), HasSubstr("not a JSON object"));
  EXPECT_THAT(messageOfFile("{}"), HasSubstr("position_m must be"));
  EXPECT_THAT(messageOfFile(R"({"position_m":{"x":0,"y":0,"z":0},"quaternion":{"x":0,"y":0,"z":0,"w":"1"}})"),
              HasSubstr("quaternion.w: a number is missing"));
  EXPECT_THAT(
      messageOfFile(R"({"position_m":{"x":0,"y":0,"z":0},"quaternion":{"x":0,"y":0,"z":0,"w":1},"tip":1})"),
      HasSubstr("'tip' is unknown"));
  EXPECT_THAT(
      messageOfFile(
          R"({"position_m":{"x":0,"y":0,"z":0},"quaternion":{"x":0,"y":0,"z":0,"w":1},"calibration":1})"),
      HasSubstr("'calibration' is unknown"));
  EXPECT_THAT(
      messageOfFile(R"({"position_m":{"x":1e400,"y":0,"z":0},"quaternion":{"x":0,"y":0,"z":0,"w":1}})"),
      HasSubstr("--tool"));
}

}  // namespace
}  // namespace needlelab
