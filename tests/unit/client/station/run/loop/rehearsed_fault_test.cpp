#include "client/device/device.h"

#include <gtest/gtest.h>

#include "common/haptics/gate/force_gate.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab::test {
namespace {

TEST(RehearsedFault, isReportedForHalfASecondAndThenTheDeviceIsWell) {
  RehearsedFault device(
      std::make_unique<FakeDevice>([](std::uint64_t, DeviceReading&) { return DeviceRead::kFresh; }), 0.2);
  ASSERT_TRUE(device.open(1000).ok());
  DeviceReading reading;
  for (std::uint64_t tick = 0; tick < 2000; ++tick) {
    EXPECT_EQ(device.status(), tick > 200 ? "a rehearsed fault: the device is well" : "") << tick;
    EXPECT_EQ(device.read(reading), DeviceRead::kFresh);
    EXPECT_EQ((reading.condition & kDeviceTrouble) != 0, tick >= 200 && tick < 700) << tick;
  }
}

TEST(RehearsedFault, missedTicksCount) {
  RehearsedFault device(
      std::make_unique<FakeDevice>([](std::uint64_t, DeviceReading&) { return DeviceRead::kFresh; }), 0.2);
  ASSERT_TRUE(device.open(1000).ok());
  EXPECT_EQ(device.skip(199), 199u);
  DeviceReading reading;
  device.read(reading);
  EXPECT_EQ(reading.condition, 0u);
  device.read(reading);
  EXPECT_EQ(reading.condition, kDeviceTrouble);
}

}  // namespace
}  // namespace needlelab::test
