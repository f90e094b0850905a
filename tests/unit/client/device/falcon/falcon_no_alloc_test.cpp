// read() and write() on the haptic thread never use the heap, whatever the device does.
#include <gtest/gtest.h>

#include "client/device/falcon/falcon_device.h"
#include "common/haptics/device_condition.h"
#include "tests/support/device_world.h"
#include "tests/support/fake_falcon.h"
#include "tests/support/no_alloc.h"

namespace needlelab::falcon {
namespace {

TEST(FalconDeviceHeap, hapticSideUsesNoneInGoodAndBadTimes) {
  const auto falcon = std::make_shared<FakeFalcon>();
  test::DeviceWorld world;
  world.listen("falcon-usb", [&] { return falcon->nextEventNs(); });
  FalconDevice device({}, std::make_unique<FakeBus>(falcon, world), world, world);
  ASSERT_TRUE(device.open(1000).ok());
  ForceGate gate(device.info().limits, 1000);
  DeviceReading reading;
  std::uint64_t calls = 0, fresh = 0;
  std::uint32_t seen = 0;
  const auto loop = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      {
        const test::NoAllocScope scope;
        const bool is_fresh = device.read(reading) == DeviceRead::kFresh;
        TipSample tip;
        tip.p_WT_m = reading.X_WH.p;
        gate.admit(tip, is_fresh, reading.speed_mps);
        device.write(gate.guard({{2, 1, 0}, {}}));
        device.skip(1);
        calls += scope.calls();
        fresh += is_fresh ? 1 : 0;
        seen |= reading.condition;
      }
      world.sleepForNs(test::kMs);
    }
  };
  const auto set = [&](auto&& change) {
    const std::scoped_lock lock(falcon->mutex);
    change(*falcon);
  };
  loop(200);
  EXPECT_EQ(fresh, 200u);
  set([](FakeFalcon& f) { f.homed = 0; });
  loop(100);
  set([](FakeFalcon& f) { f.homed = 0x70, f.garbage = true; });
  loop(200);
  set([](FakeFalcon& f) { f.garbage = false; });
  falcon->unplug();
  loop(100);
  falcon->plugIn();
  loop(300);
  EXPECT_EQ(seen & (kDeviceNotReady | kDeviceTrouble | kDeviceLost),
            kDeviceNotReady | kDeviceTrouble | kDeviceLost);
  EXPECT_EQ(calls, 0u);
}

}  // namespace
}  // namespace needlelab::falcon
