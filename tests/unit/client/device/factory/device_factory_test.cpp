#include <gmock/gmock.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "client/device/factory/device_factory.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

TEST(DeviceFactory, unknownKindsAreRefusedWithTheListOfThoseThatExist) {
  for (const char* spec : {"joystick", "", "Recording:x.csv", ":", "virtuos"}) {
    auto device = makeDevice(spec, {});
    ASSERT_FALSE(device.ok()) << spec;
    EXPECT_EQ(device.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(device.error().message, HasSubstr(std::string("'") + spec + "'"));
    EXPECT_THAT(device.error().message, HasSubstr("recording:FILE"));
  }
}

TEST(DeviceFactory, aRecordingNeedsAFileThatIsThere) {
  auto none = makeDevice("recording:", {});
  ASSERT_FALSE(none.ok());
  EXPECT_THAT(none.error().message, HasSubstr("needs a file"));
  auto missing = makeDevice("recording:/nowhere/at/all.csv", {});
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(missing.error().message, HasSubstr("/nowhere/at/all.csv"));
}

TEST(DeviceFactory, theSimulatedDeviceRendersForceAndItsPlanMustFitTheScene) {
  DeviceOptions options;
  options.scene.layers.resize(1);
  options.scene.layers[0].thickness_m = 0.02;
  auto device = makeDevice("simulated", options);
  ASSERT_TRUE(device.ok()) << device.error().message;
  EXPECT_TRUE((*device)->info().renders_force);
  options.hand.plan = "target:nowhere";
  auto no_target = makeDevice("simulated", options);
  ASSERT_FALSE(no_target.ok());
  EXPECT_EQ(no_target.error().code, ErrorCode::kInvalidInput);
  EXPECT_FALSE(makeDevice("simulated:x", options).ok());
}

TEST(DeviceFactory, aRecordingIsADeviceWithoutForce) {
  const auto path = std::filesystem::temp_directory_path() / "needlelab:factory,test.csv";
  std::ofstream(path) << "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n0,1,2,3,0,0,0,1\n";
  auto device = makeDevice("recording:" + path.string(), {});
  std::filesystem::remove(path);
  ASSERT_TRUE(device.ok()) << device.error().message;
  EXPECT_FALSE((*device)->info().renders_force);
  EXPECT_THAT((*device)->info().name, HasSubstr("factory,test.csv"));
}

TEST(DeviceFactory, aVirtuoseHasAnAddress) {
  auto device = makeDevice("virtuose", {});
  ASSERT_TRUE(device.ok());
  EXPECT_THAT((*device)->info().name, HasSubstr("127.0.0.1#53210"));
  device = makeDevice("virtuose:haptic.lab#5000", {});
  ASSERT_TRUE(device.ok());
  EXPECT_THAT((*device)->info().name, HasSubstr("haptic.lab#5000"));
  device = makeDevice("virtuose:haptic.lab#none", {});
  ASSERT_FALSE(device.ok());
  EXPECT_EQ(device.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(device.error().message, HasSubstr("HOST#PORT"));
}

}  // namespace
}  // namespace needlelab
