// Recorded hands: the engine at the station's rate compared with itself, on paths with a known answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "client/sim/accuracy/study.h"
#include "tests/support/recordings/recordings.h"

namespace needlelab {
namespace {

// straight into the ball at `speed_mps`, in ticks of the fine rate
RecordedHand straightHand(double speed_mps) {
  RecordedHand hand{"straight", {}, {{0, 0, -0.04}, 0.04}, {1, 0, 0, 0}};
  const double way_m = speed_mps / (kReplayFactor * kStationRate_hz);
  for (int i = 0; i * way_m < 0.02; ++i) hand.path_m.push_back({0, 0, 0.001 - i * way_m});
  return hand;
}

// a spring that follows: the held force lags by half a tick on average, v·T/2·K, spread over the tick
TEST(Replay, aSpringsErrorIsHalfATickPlusTheEncoderStep) {
  SceneSpec scene;
  scene.axial_model = AxialModel::kVoigt;
  scene.needle_length_m = 1;
  scene.max_force_N = 50;
  scene.effects = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  scene.voigt.stiffness_N_per_m = 500;
  scene.voigt.damping_Ns_per_m = 0;
  scene.layers.emplace_back();
  scene.layers[0].thickness_m = 1;
  scene.layers[0].cutting_force_N = 40;
  constexpr double kSpeed = 0.2;
  const auto error = replayError(scene, straightHand(kSpeed));
  ASSERT_TRUE(error.ok()) << error.error().message;
  // rms of 0 … 15 sixteenths of a tick's distance, at 500 N/m; the encoder's 10 µm add at most 2.5 mN
  const double tick_N = 500 * kSpeed / kStationRate_hz;
  const double held_N = tick_N * std::sqrt(15.0 * 31 / 6) / 16;
  EXPECT_NEAR(error->rms_N(), held_N, 0.0026);
}

TEST(ReplayRows, eachModelOnceAlongHandsWithAnIntervalOverThem) {
  AccuracyOptions options;
  options.data = test::preferredRecordings().folder;
  std::vector<std::string> notes;
  const auto rows = replayRows(
      options, [](std::string_view, double) {}, notes);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->size(), kAxialModelCount + 1) << "VOIGT twice";
  for (const AccuracyRow& row : *rows) {
    EXPECT_GT(row.error_N->count, 1u) << row.model;
    EXPECT_LE(row.error_N->low, row.error_N->mean);
    EXPECT_GE(row.error_N->high, row.error_N->mean);
    EXPECT_LT(*row.beyond, 0.05) << row.model;
  }
}

TEST(ReplayRows, withoutRecordingsSayWhatToDo) {
  AccuracyOptions options;
  options.data = "/nonexistent";
  std::vector<std::string> notes;
  const auto rows = replayRows(
      options, [](std::string_view, double) {}, notes);
  ASSERT_TRUE(rows.ok());
  EXPECT_TRUE(rows->empty());
  EXPECT_THAT(notes, testing::ElementsAre(testing::HasSubstr("NEEDLELAB_DATA")));
}

}  // namespace
}  // namespace needlelab
