#include "client/device/recording/recording_device.h"

#include <gmock/gmock.h>

namespace needlelab {
namespace {

using testing::HasSubstr;

PoseTrack played(std::vector<double> t_s, std::vector<Pose> poses) {
  return {std::move(t_s), std::move(poses), {}, {}};
}

TEST(RecordingDevice, playsATickAReadSkipsMissedOnesAndEnds) {
  std::vector<double> t_s;
  std::vector<Pose> poses;
  for (int k = 0; k < 10; ++k) {
    t_s.push_back(k * 0.001);
    poses.push_back({{static_cast<double>(k), 0, 0}, {}});
  }
  RecordingDevice device(played(t_s, poses), "test");
  ASSERT_TRUE(device.open(1000).ok());
  DeviceReading reading;
  const auto next = [&] { return device.read(reading) == DeviceRead::kFresh ? reading.X_WH.p.x : -1; };
  EXPECT_EQ(next(), 0);
  EXPECT_EQ(next(), 1);
  EXPECT_EQ(device.skip(3), 3u);
  EXPECT_EQ(next(), 5);
  device.write({});
  EXPECT_EQ(device.skip(1000), poses.size() - 6) << "ticks after the recording's end do not count";
  EXPECT_EQ(device.read(reading), DeviceRead::kFinished);
  device.close();
  // Opened again, it starts from the beginning.
  ASSERT_TRUE(device.open(1000).ok());
  EXPECT_EQ(next(), 0);
}

TEST(RecordingDevice, aTrackTooLongForItsRateIsRefused) {
  RecordingDevice device(played({0, 1e300}, {{}, {}}), "long.csv");
  auto status = device.open(1000);
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("long.csv"));
  // two rows may be hours apart
  RecordingDevice four_hours(played({0, 14'400}, {{}, {}}), "four hours");
  status = four_hours.open(1000);
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("at most 14400000"));
}

TEST(RecordingDevice, saysWhetherItHasAPlunger) {
  PoseTrack track = played({0, 0.002}, {{}, {}});
  EXPECT_EQ(RecordingDevice(track, "a.csv").info().plunger, PlungerSource::kNone);
  track.plunger = {0.25, 0.75};
  EXPECT_EQ(RecordingDevice(track, "a.csv").info().plunger, PlungerSource::kAnalog);
}

}  // namespace
}  // namespace needlelab
