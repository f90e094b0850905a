/// What the modes beside the lesson ask of a command line.

#include <gmock/gmock.h>

#include "client/station/run/options.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

struct ParsedMode {
  ParsedOptions parsed;
  std::string err;
};
ParsedMode parse(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "needlelab-station");
  testing::internal::CaptureStderr();
  ParsedMode outcome;
  outcome.parsed = parseStationOptions(static_cast<int>(arguments.size()), arguments.data());
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

TEST(ModeOptions, noModeButTheLessonNeedsAnExercise) {
  EXPECT_EQ(parse({"--headless"}).parsed.exit_code, kExitInvalid);
  const std::pair<const char*, StationMode> modes[] = {{"--list-devices", StationMode::kListDevices},
                                                       {"--self-test", StationMode::kSelfTest},
                                                       {"--calibrate", StationMode::kCalibrate}};
  for (const auto& [name, mode] : modes) {
    const auto outcome = parse({name});
    EXPECT_FALSE(outcome.parsed.exit_code) << outcome.err;
    EXPECT_EQ(outcome.parsed.options.mode, mode);
  }
}

TEST(ModeOptions, theSelfTestAsksAServerWithoutATrainee) {
  EXPECT_FALSE(
      parse({"--self-test", "--server", "lab:7750", "--ca", "ca.crt", "--key", "s.key"}).parsed.exit_code);
  EXPECT_THAT(parse({"--self-test", "--server", "lab:7750", "--ca", "ca.crt"}).err, HasSubstr("--key"));
}

TEST(ModeOptions, excludeEachOther) {
  EXPECT_THAT(parse({"--self-test", "--calibrate"}).err, HasSubstr("excludes"));
  EXPECT_EQ(parse({"--list-devices", "--self-test"}).parsed.exit_code, kExitInvalid);
}

TEST(ModeOptions, outBelongsToCalibrate) {
  const auto outcome = parse({"--self-test", "--out", "tool.json"});
  EXPECT_EQ(outcome.parsed.exit_code, kExitInvalid);
  EXPECT_THAT(outcome.err, HasSubstr("add --calibrate"));
  const auto given = parse({"--calibrate", "--tool", "0,0,0.1,0,0,0,1", "--axis", "given"});
  ASSERT_FALSE(given.parsed.exit_code) << given.err;
  EXPECT_TRUE(given.parsed.options.tool_given);
  EXPECT_EQ(given.parsed.options.axis, "given");
}

}  // namespace
}  // namespace needlelab
