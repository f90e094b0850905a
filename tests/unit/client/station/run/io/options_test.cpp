#include <gmock/gmock.h>

#include "client/station/run/io/options.h"
#include "common/base/program.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

// The program's output and exit code for a command line.
struct Outcome {
  ParsedOptions parsed;
  std::string out, err;
};
Outcome parse(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "needlelab-station");
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.parsed = parseStationOptions(static_cast<int>(arguments.size()), arguments.data());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

TEST(StationOptions, theHapticThreadsCoreAndSpin) {
  const auto outcome = parse({"--profile", "p.json", "--cpu", "1", "--spin-us", "80"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  EXPECT_EQ(outcome.parsed.options.cpu, 1);
  EXPECT_EQ(outcome.parsed.options.spin_us, 80);
  EXPECT_EQ(parse({"--profile", "p.json"}).parsed.options.cpu, std::nullopt);
  for (const char* spin : {"201", "-1", "nan", "much"})
    EXPECT_EQ(parse({"--profile", "p.json", "--spin-us", spin}).parsed.exit_code, kExitInvalid) << spin;
  for (const char* core : {"-1", "1.5", "one"})
    EXPECT_EQ(parse({"--profile", "p.json", "--cpu", core}).parsed.exit_code, kExitInvalid) << core;
}

TEST(StationOptions, passivityControlIsAskedFor) {
  EXPECT_FALSE(parse({"--profile", "p.json"}).parsed.options.passivity_control);
  EXPECT_TRUE(parse({"--profile", "p.json", "--passivity-control"}).parsed.options.passivity_control);
}

TEST(StationOptions, aWholeCommandLine) {
  const auto outcome = parse({"--server",
                              "lab:7751",
                              "--ca",
                              "ca.crt",
                              "--key",
                              "s.key",
                              "--trainee",
                              "tom",
                              "--exercise",
                              "knee",
                              "--device",
                              "recording:x.csv",
                              "--rate",
                              "2000",
                              "--seconds",
                              "2.5",
                              "--headless",
                              "--spool",
                              "sp",
                              "--spool-keep",
                              "2",
                              "--spool-quota",
                              "10",
                              "--drain",
                              "3",
                              "--json",
                              "out.json",
                              "--tool",
                              "0,0,0.15,0,0,0,1",
                              "--placement",
                              "0.1,0.2,0.3,1,0,0,0",
                              "--hand-seed",
                              "9"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  const StationOptions& o = outcome.parsed.options;
  EXPECT_EQ(endpointsText(o.servers), "lab:7751");
  EXPECT_EQ(o.trainee, "tom");
  EXPECT_EQ(o.exercise, "knee");
  EXPECT_EQ(o.device, "recording:x.csv");
  EXPECT_EQ(o.rate_hz, 2000);
  EXPECT_EQ(o.seconds, 2.5);
  EXPECT_TRUE(o.headless);
  EXPECT_EQ(o.spool, "sp");
  EXPECT_EQ(o.keep.age_s, 2 * 86'400);
  EXPECT_EQ(o.keep.quota_bytes, 10u << 20);
  EXPECT_EQ(o.drain_s, 3);
  EXPECT_TRUE(o.json);
  EXPECT_EQ(o.json_file, "out.json");
  EXPECT_EQ(o.X_HT.p, (Vec3{0, 0, 0.15}));
  EXPECT_EQ(o.X_WL.q, (Quat{1, 0, 0, 0}));
  EXPECT_EQ(o.hand.seed, 9u);
  EXPECT_EQ(o.station, "") << "the key file's name counts";
}

TEST(StationOptions, severalServersComeFromTheCommandLineOrFromTheEnrolment) {
  const auto outcome = parse({"--server", "b,a:7751", "--ca", "c", "--key", "k"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  EXPECT_EQ(endpointsText(outcome.parsed.options.servers), "b:7750,a:7751");
  EXPECT_THAT(parse({"--server", "a,b:x", "--ca", "c", "--key", "k"}).err,
              HasSubstr("'b:x' is no HOST:PORT"));
  const test::TempFolder folder;
  folder.write("server", "a.example:7750,b.example:7750\n");
  const std::string kept = folder.path();
  const auto enrolled = parse({"--enrolled", kept.c_str()});
  ASSERT_FALSE(enrolled.parsed.exit_code) << enrolled.err;
  EXPECT_EQ(endpointsText(enrolled.parsed.options.servers), "a.example:7750,b.example:7750");
}

TEST(StationOptions, practiceWithoutAServerNeedsOnlyAProfile) {
  const auto outcome = parse({"--profile", "p.json", "--json"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  EXPECT_TRUE(outcome.parsed.options.json);
  EXPECT_TRUE(outcome.parsed.options.json_file.empty());
  EXPECT_TRUE(outcome.parsed.options.servers.empty());
  EXPECT_EQ(outcome.parsed.options.station, "") << "the upload names it";
  EXPECT_EQ(outcome.parsed.options.trainee, "guest");
  EXPECT_FALSE(outcome.parsed.options.spool.empty());
}

TEST(StationOptions, wrongUsageExitsWithTwoAndNamesWhatIsMissing) {
  const std::vector<std::pair<std::vector<const char*>, std::string>> cases = {
      {{"--headless"}, "--exercise ID"},
      {{"--start"}, "the window asks"},
      {{"--exercise", "a", "--profile", "b"}, "exclude each other"},
      {{"--server", "x", "--exercise", "a", "--trainee", "t", "--key", "k"}, "--ca"},
      {{"--server", "x", "--exercise", "a", "--trainee", "t", "--ca", "c"}, "--key"},
      {{"--headless", "--server", "x", "--exercise", "a", "--ca", "c", "--key", "k"}, "--trainee"},
      {{"--start", "--server", "x", "--exercise", "a", "--ca", "c", "--key", "k"}, "--trainee"},
      {{"--profile", "p", "--screenshot", "a.png"}, "--at"},
      {{"--profile", "p", "--screenshot", "a.png", "--at", "later"}, "later"},
      {{"--profile", "p", "--screenshot", "a.png", "--at", "-1"}, "-1"},
      {{"--profile", "p", "--screenshot", "a.png", "--at", "nan"}, "nan"},
      {{"--profile", "p", "--screenshot", "p", "--at", "1"}, "--screenshot"},
      {{"--profile", "p", "--frame-log", "p"}, "--frame-log"},
      {{"--profile", "p", "--window", "1280"}, "--window"},
      {{"--profile", "p", "--window", "1280x72x"}, "--window"},
      {{"--profile", "p", "--window", "100x100"}, "640x360"},
      {{"--profile", "p", "--font-scale", "3"}, "--font-scale"},
      {{"--profile", "p", "--monitor", "24"}, "--monitor '24', allowed is a length from 10in to 120in"},
      {{"--profile", "p", "--monitor", "0.6m"}, "--monitor '0.6m'"},
      {{"--profile", "p", "--monitor", "121in"}, "from 10in to 120in"},
      {{"--profile", "p", "--monitor", "nanin"}, "--monitor 'nanin'"},
      {{"--profile", "p", "--viewing-distance", "200"},
       "--viewing-distance '200', allowed is a length from 0.3m to 6m"},
      {{"--profile", "p", "--viewing-distance", "2000mm"}, "--viewing-distance '2000mm'"},
      {{"--profile", "p", "--viewing-distance", "0.2m"}, "from 0.3m to 6m"},
      {{"--server", "x:99999", "--exercise", "a", "--trainee", "t", "--ca", "c", "--key", "k"}, "99999"},
      {{"--profile", "p", "--rate", "49"}, "--rate"},
      {{"--profile", "p", "--trainee", "a\tb"}, "--trainee"},
      {{"--profile", "p", "--trainee", "\xff\xfe"}, "--trainee"},
      {{"--profile", "p", "--trainee", "nnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnn"},
       "--trainee"},
      {{"--profile", "p", "--station", " x"}, "--station"},
      {{"--profile", "p", "--rate", "nan"}, "--rate"},
      {{"--profile", "p", "--seconds", "-1"}, "--seconds"},
      {{"--profile", "p", "--seconds", "inf"}, "--seconds"},
      {{"--profile", "p", "--tool", "0,0,142,0,0,0,1"}, "looks like millimetres"},
      {{"--profile", "p", "--placement", "0,0,0,0,0,0,2"}, "--placement"},
      {{"--profile", "p", "--fly"}, "--fly"},
      {{"--profile", "p", "--on-fault", "ignore"}, "--on-fault"},
      {{"--profile", "p", "--hand-tremor-m", "1"}, "--hand-tremor-m"},
  };
  for (const auto& [arguments, expected] : cases) {
    const auto outcome = parse(arguments);
    ASSERT_TRUE(outcome.parsed.exit_code) << expected;
    EXPECT_EQ(*outcome.parsed.exit_code, kExitInvalid) << expected;
    EXPECT_THAT(outcome.err, HasSubstr(expected));
    EXPECT_TRUE(outcome.out.empty());
  }
}

TEST(StationOptions, aCodeFileNeedsAHeadlessLessonWithAServer) {
  const std::vector<const char*> lesson = {"--profile", "p", "--code-file", "code"};
  const auto with = [&](std::vector<const char*> more) {
    more.insert(more.end(), lesson.begin(), lesson.end());
    return parse(more);
  };
  const std::vector<const char*> server = {"--server", "x", "--ca", "c", "--key", "k", "--trainee", "tom"};
  auto headless = server;
  headless.push_back("--headless");
  const auto outcome = with(headless);
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  EXPECT_EQ(outcome.parsed.options.code_file, "code");
  EXPECT_EQ(with(server).parsed.exit_code, kExitInvalid);
  EXPECT_THAT(with(server).err, HasSubstr("the window has a field"));
  EXPECT_EQ(with({"--headless"}).parsed.exit_code, kExitInvalid);
  EXPECT_THAT(with({"--headless"}).err, HasSubstr("give --server or --enrolled"));
  auto to_it = headless;
  to_it.insert(to_it.end(), {"--json", "code"});
  EXPECT_EQ(with(to_it).parsed.exit_code, kExitInvalid) << "the summary would take its place";
}

TEST(StationOptions, theFaultActionIsChosenOrFollowsTheTerminal) {
  EXPECT_EQ(parse({"--profile", "p"}).parsed.options.on_fault, std::nullopt);
  EXPECT_EQ(parse({"--profile", "p", "--on-fault", "wait"}).parsed.options.on_fault, FaultPolicy::kWait);
  EXPECT_EQ(parse({"--profile", "p", "--on-fault", "end"}).parsed.options.on_fault, FaultPolicy::kEnd);
}

TEST(StationOptions, aWindowNeedsNeitherExerciseNorTraineeBecauseItAsks) {
  const auto outcome = parse({"--server", "x", "--ca", "c", "--key", "k"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  EXPECT_TRUE(outcome.parsed.options.opensWindow());
  EXPECT_FALSE(outcome.parsed.options.trainee_given);
  EXPECT_TRUE(parse({"--trainee", "tom"}).parsed.options.trainee_given);
  EXPECT_FALSE(parse({"--headless", "--profile", "p"}).parsed.options.opensWindow());
  EXPECT_FALSE(parse({"--self-test"}).parsed.options.opensWindow()) << "only a lesson has one";
}

TEST(StationOptions, theWindowsSizeLettersAndPictures) {
  const auto outcome =
      parse({"--profile",    "p",     "--window", "1600x900",     "--font-scale", "1.5",       "--screenshot",
             "a.png",        "--at",  "2.5",      "--screenshot", "b.png",        "--at",      "end",
             "--screenshot", "c.png", "--at",     "start",        "--frame-log",  "frames.csv"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  const WindowOptions& window = outcome.parsed.options.window;
  EXPECT_TRUE(window.size_given);
  EXPECT_EQ(window.width_px, 1600);
  EXPECT_EQ(window.height_px, 900);
  EXPECT_EQ(window.font_scale, 1.5);
  ASSERT_EQ(window.pictures.size(), 3u);
  EXPECT_EQ(window.pictures[0].file, "a.png");
  EXPECT_EQ(window.pictures[0].when, PictureRequest::When::kLesson);
  EXPECT_EQ(window.pictures[0].at_s, 2.5);
  EXPECT_EQ(window.pictures[1].when, PictureRequest::When::kEnd);
  EXPECT_EQ(window.pictures[2].when, PictureRequest::When::kStart);
  EXPECT_EQ(window.frame_log, "frames.csv");
  EXPECT_EQ(parse({"--profile", "p"}).parsed.options.window.font_scale, std::nullopt) << "as it was left";
}

TEST(StationOptions, theWindowTakesTheWholeScreenUnlessItIsForADesk) {
  EXPECT_FALSE(parse({"--profile", "p"}).parsed.options.window.windowed);
  EXPECT_TRUE(parse({"--profile", "p", "--windowed"}).parsed.options.window.windowed);
  EXPECT_FALSE(parse({"--profile", "p", "--windowed"}).parsed.options.window.size_given) << "as it was left";
  EXPECT_TRUE(parse({"--profile", "p", "--window", "1280x720"}).parsed.options.window.windowed);
}

TEST(StationOptions, theMonitorsPlacementIsParsed) {
  const Viewing usual = parse({"--profile", "p"}).parsed.options.window.viewing;
  EXPECT_NEAR(usual.diagonal_m, 0.6096, 1e-12);
  EXPECT_EQ(usual.distance_m, 2);
  const auto outcome = parse({"--profile", "p", "--monitor", "31.5in", "--viewing-distance", "2.4m"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  EXPECT_NEAR(outcome.parsed.options.window.viewing.diagonal_m, 31.5 * 0.0254, 1e-12);
  EXPECT_EQ(outcome.parsed.options.window.viewing.distance_m, 2.4);
  for (const char* end : {"10in", "120in"})
    EXPECT_FALSE(parse({"--profile", "p", "--monitor", end}).parsed.exit_code) << end;
}

TEST(StationOptions, aStudentsStationCannotBeQuit) {
  EXPECT_TRUE(parse({"--profile", "p"}).parsed.options.window.may_quit);
  const auto outcome = parse({"--profile", "p", "--no-quit"});
  ASSERT_FALSE(outcome.parsed.exit_code) << outcome.err;
  EXPECT_FALSE(outcome.parsed.options.window.may_quit);
}

TEST(StationOptions, anExplicitPlanDiffersFromTheDefault) {
  EXPECT_FALSE(parse({"--profile", "p"}).parsed.options.hand_plan_given);
  EXPECT_TRUE(parse({"--profile", "p", "--hand-plan", "pointer"}).parsed.options.hand_plan_given);
}

TEST(StationOptions, helpShowsEveryGroup) {
  const auto outcome = parse({"--help"});
  for (const char* group :
       {"Server", "Lesson", "Window", "Device", "Real time", "Spool", "Summary", "Instead of a lesson"})
    EXPECT_THAT(outcome.out, HasSubstr(std::string("\n") + group));
}

TEST(StationOptions, helpAndVersionEndWell) {
  for (const char* flag : {"--help", "--version"}) {
    const auto outcome = parse({flag});
    ASSERT_TRUE(outcome.parsed.exit_code);
    EXPECT_EQ(*outcome.parsed.exit_code, kExitDone);
    EXPECT_FALSE(outcome.out.empty());
  }
}

// --- the modes besides the lesson ---

TEST(ModeOptions, noModeButTheLessonNeedsAnExercise) {
  EXPECT_EQ(parse({"--headless"}).parsed.exit_code, kExitInvalid);
  const std::pair<const char*, StationMode> modes[] = {{"--list-devices", StationMode::kListDevices},
                                                       {"--self-test", StationMode::kSelfTest},
                                                       {"--calibrate", StationMode::kCalibrate},
                                                       {"--measure-delay", StationMode::kMeasureDelay}};
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
