#include <gmock/gmock.h>

#include <cmath>
#include <csignal>
#include <nlohmann/json.hpp>

#include "client/device/hand/simulated_device.h"
#include "client/device/pose_option.h"
#include "client/station/run/checks/calibrate.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/base/text/csv.h"
#include "tests/support/blocked_signals.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/device_world.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab {
namespace {

using test::BlockedSignals;
using test::DeviceWorld;
using test::FakeDevice;
using test::kMs;
using testing::HasSubstr;

// Plays a pivot motion and stores the commands written to it.
std::unique_ptr<FakeDevice> pivoting(const PivotMotion& motion) {
  auto hand = std::make_shared<PivotDevice>(motion);
  EXPECT_TRUE(hand->open(1000).ok());
  return std::make_unique<FakeDevice>(
      [hand](std::uint64_t, DeviceReading& reading) { return hand->read(reading); });
}

Result<Calibration> calibrate(Device& device, CalibrationSettings settings,
                              std::vector<CalibrationProgress>* progress = nullptr) {
  DeviceWorld world;
  settings.real_time = false;
  const auto follow = [&](const CalibrationProgress& now) {
    if (progress != nullptr) progress->push_back(now);
  };
  return calibrateTip(device, world, settings, noSignals(), follow, world, world);
}

TEST(Calibrate, findsTheTipAndWritesNothingButZeroForce) {
  PivotMotion motion;
  auto device = pivoting(motion);
  std::vector<CalibrationProgress> progress;
  const auto found = calibrate(*device, {}, &progress);
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_LT(norm(found->fit.p_HT_m - motion.X_HT.p), 2e-5);
  ASSERT_TRUE(found->halves_apart_m);
  EXPECT_LT(*found->halves_apart_m, 5e-5);
  // every tick was answered with zero force
  EXPECT_EQ(device->writes.size(), device->reads + 1);
  for (const Wrench& wrench : device->writes) EXPECT_EQ(wrench, Wrench{});
  EXPECT_EQ(progress.back().poses, found->fit.samples);
  EXPECT_GT(progress.back().spread, kMinSpread);
}

// The first tick is due after 2 ms, the owner polls every 50 ms; if both fall on the same time, the tick
// comes first.
TEST(Calibrate, endsAtTheFirstLookThatIsLateAndWideEnough) {
  auto device = pivoting({});
  CalibrationSettings settings;
  settings.settle_s = 1;
  settings.enough_s = 4;
  std::vector<CalibrationProgress> progress;
  const auto found = calibrate(*device, settings, &progress);
  ASSERT_TRUE(found.ok()) << found.error().message;
  ASSERT_GT(progress.size(), 2u);
  // the last one is reported after the end
  const std::size_t looks = progress.size() - 1;
  for (std::size_t i = 0; i < looks; ++i) {
    const CalibrationProgress& now = progress[i];
    const auto ticks = 50 * (i + 1) - 1;
    EXPECT_NEAR(now.t_s, 1e-3 * static_cast<double>(ticks) - settings.settle_s, 1e-9);
    EXPECT_EQ(now.poses, ticks > 1000 ? ticks - 1000 : 0);
    const bool enough = now.t_s >= settings.enough_s && now.spread >= 2 * kMinSpread;
    EXPECT_EQ(enough, i + 1 == looks) << now.t_s << " s, " << now.spread;
  }
  // one more tick, in which the loop notices
  EXPECT_EQ(device->reads, 50 * looks);
  EXPECT_EQ(found->fit.samples, 50 * looks - 1000);
}

TEST(Calibrate, aSignalEndsItAndNothingIsFound) {
  const BlockedSignals blocked{SIGTERM};
  auto device = pivoting({});
  DeviceWorld world;
  world.at(world.nowNs() + 120 * kMs, [] { ::raise(SIGTERM); });
  CalibrationSettings settings;
  settings.real_time = false;
  const auto found = calibrateTip(
      *device, world, settings, blocked.set(), [](const auto&) {}, world, world);
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().code, ErrorCode::kFailed);
  EXPECT_THAT(found.error().message, HasSubstr("stopped"));
  EXPECT_EQ(device->reads, 150u) << "seen at the look at 150 ms, ended at the tick behind it";
  for (const Wrench& wrench : device->writes) EXPECT_EQ(wrench, Wrench{});
}

TEST(Calibrate, whatComesWhileTheTipGoesIntoTheDimpleIsNotUsed) {
  PivotMotion motion;
  auto hand = std::make_shared<PivotDevice>(motion);
  ASSERT_TRUE(hand->open(1000).ok());
  FakeDevice device([hand](std::uint64_t tick, DeviceReading& reading) {
    const DeviceRead read = hand->read(reading);
    if (tick < 3000) reading.X_WH.p.z += 0.1;
    return read;
  });
  CalibrationSettings settings;
  settings.seconds = 12;
  const auto found = calibrate(device, settings);
  ASSERT_TRUE(found.ok());
  EXPECT_EQ(found->fit.samples, 12'000u);
  EXPECT_EQ(found->fit.used, 12'000u);
}

TEST(Calibrate, aSilentDeviceIsReported) {
  FakeDevice device([](std::uint64_t, DeviceReading&) { return DeviceRead::kNoUpdate; });
  const auto found = calibrate(device, {1000, 1, 0, 1, false});
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(found.error().message, HasSubstr("gave no pose"));
}

TEST(Calibrate, aRecordingIsReadToItsEnd) {
  PivotMotion motion;
  motion.seconds = 20;
  auto device = pivoting(motion);
  CalibrationSettings settings;
  settings.settle_s = 0;
  settings.seconds = settings.enough_s = 600;
  const auto found = calibrate(*device, settings);
  ASSERT_TRUE(found.ok());
  EXPECT_EQ(found->fit.samples, 20'000u);
}

TEST(NeedleAxis, isReadFromItsWords) {
  EXPECT_EQ(parseNeedleAxis("from-tip")->source, NeedleAxis::Source::kFromTip);
  EXPECT_EQ(parseNeedleAxis("given")->source, NeedleAxis::Source::kGiven);
  test::TempFolder folder;
  const auto file = folder.write("hub.json", toolFileText({{0.01, 0, 0.1}, {}}, {}));
  const auto hub = parseNeedleAxis("hub:" + file.string());
  ASSERT_TRUE(hub.ok()) << hub.error().message;
  EXPECT_EQ(hub->p_HH_m, (Vec3{0.01, 0, 0.1}));
  for (const char* wrong : {"", "tip", "hub", "hub:", "hub:/nowhere.json"}) {
    const auto axis = parseNeedleAxis(wrong);
    ASSERT_FALSE(axis.ok()) << wrong;
    EXPECT_EQ(axis.error().code, ErrorCode::kInvalidInput) << wrong;
  }
}

TEST(NeedleAxis, pointsAsDocumentedInItsSource) {
  const Vec3 tip{0.03, -0.02, 0.12}, hub{0.03, -0.02, 0.05};
  const auto from_tip = toolOf(tip, {}, {});
  ASSERT_TRUE(from_tip.ok());
  EXPECT_EQ(from_tip->p, tip);
  EXPECT_LT(norm(zAxis(from_tip->q) - normalized(tip)), 1e-12);
  const auto from_hub = toolOf(tip, {NeedleAxis::Source::kHub, hub}, {});
  EXPECT_LT(norm(zAxis(from_hub->q) - Vec3{0, 0, 1}), 1e-12);
  const Quat given{0, std::sqrt(0.5), 0, std::sqrt(0.5)};
  EXPECT_EQ(toolOf(tip, {NeedleAxis::Source::kGiven, {}}, {{}, given})->q, given);
}

TEST(NeedleAxis, keepsTheTurnOfTheGivenTool) {
  // The given tool already points along the tip: no rotation, and its roll is kept.
  const Vec3 tip{0, 0, 0.15};
  const Quat rolled{0, 0, std::sin(0.6), std::cos(0.6)};
  const auto tool = toolOf(tip, {}, {{}, rolled});
  EXPECT_NEAR(std::abs(dot(tool->q, rolled)), 1, 1e-12);
}

TEST(NeedleAxis, twoPointsTooNearGiveNoDirection) {
  const auto tool = toolOf({0, 0, 0.01}, {}, {});
  ASSERT_FALSE(tool.ok());
  EXPECT_THAT(tool.error().message, HasSubstr("only 10.0 mm from the handle's origin"));
}

TEST(ToolFile, isReadAsTheToolOfALesson) {
  test::TempFolder folder;
  const Pose tool{{0.012, -0.008, 0.142}, normalized(Quat{0.1, 0.2, 0.3, 0.9})};
  const auto file =
      folder.write("tool.json", toolFileText(tool, {1'000'000'000, "a \xff device", "from-tip", 9, 8}));
  const auto read = parsePoseOption(file.string(), "--tool");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, (Pose{tool.p, normalized(tool.q)}));
}

// --- the command ---

struct Outcome {
  int code = 0;
  std::string out, err;
};
Outcome command(StationOptions options) {
  options.mode = StationMode::kCalibrate;
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.code = runCalibrate(options, noSignals());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

// the motion as a recording file
std::string recordingOf(const test::TempFolder& folder, const PivotMotion& motion, double seconds) {
  PivotDevice device(motion);
  EXPECT_TRUE(device.open(250).ok());
  std::string csv = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  DeviceReading reading;
  for (int tick = 0; tick < 250 * seconds; ++tick) {
    device.read(reading);
    const Pose& X = reading.X_WH;
    csv += numberText(tick * 0.004);
    for (const double value : {X.p.x, X.p.y, X.p.z, X.q.x, X.q.y, X.q.z, X.q.w}) {
      csv += ',';
      appendNumber(csv, value);
    }
    csv += '\n';
  }
  return "recording:" + folder.write("pivot.csv", csv).string();
}

TEST(CalibrateCommand, writesAToolFileFromARecording) {
  test::TempFolder folder;
  StationOptions options;
  options.device = recordingOf(folder, {}, 16);
  options.tool_out = folder.path() / "tool.json";
  const auto outcome = command(options);
  EXPECT_EQ(outcome.code, kExitDone) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("x 12.00  y -8.00  z 142.00 mm"));
  EXPECT_THAT(outcome.out, HasSubstr("error to expect"));
  EXPECT_THAT(outcome.err, HasSubstr("the device gives no force"));
  const auto tool = parsePoseOption(options.tool_out.string(), "--tool");
  ASSERT_TRUE(tool.ok()) << tool.error().message;
  EXPECT_LT(norm(tool->p - PivotMotion{}.X_HT.p), 2e-5);
  EXPECT_LT(norm(zAxis(tool->q) - normalized(PivotMotion{}.X_HT.p)), 1e-3);
}

TEST(CalibrateCommand, aRefusedRunLeavesTheOldToolAlone) {
  test::TempFolder folder;
  PivotMotion small;
  small.swing_rad = 0.08;
  StationOptions options;
  options.device = recordingOf(folder, small, 16);
  options.tool_out = folder.write("tool.json", "old");
  options.json = true;
  const auto outcome = command(options);
  EXPECT_EQ(outcome.code, kExitFailed);
  EXPECT_THAT(outcome.err, HasSubstr("REFUSED: the swing was too small"));
  EXPECT_EQ(std::filesystem::file_size(options.tool_out), 3u);
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["rows"][0]["ok"], false);
  EXPECT_THAT(json["rows"][0]["trouble"].get<std::string>(), HasSubstr("20°"));
}

TEST(CalibrateCommand, wrongInputIsExitCodeTwo) {
  StationOptions options;
  options.axis = "sideways";
  EXPECT_EQ(command(options).code, kExitInvalid);
  options = {};
  options.device = "nothing";
  EXPECT_EQ(command(options).code, kExitInvalid);
  options = {};
  options.seconds = 601;
  const auto outcome = command(options);
  EXPECT_EQ(outcome.code, kExitInvalid);
  EXPECT_THAT(outcome.err, HasSubstr("--seconds of a calibration: 601 is out of range [0.001, 600]"));
}

}  // namespace
}  // namespace needlelab
