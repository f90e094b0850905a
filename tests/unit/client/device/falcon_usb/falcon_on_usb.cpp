#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

#include <cmath>
#include <utility>

#include "common/base/time/time_source.h"

namespace needlelab::test {

void FalconOnUsb::SetUp() {
  if (const std::string why = testbed_.trouble(); !why.empty()) GTEST_SKIP() << why;
}

void FalconOnUsb::TearDown() {
  if (device_) device_->close();
}

FalconOptions FalconOnUsb::options(const std::string& which) {
  FalconOptions options;
  options.priority = 0;
  options.which = which;
  return options;
}

void FalconOnUsb::openDevice(FalconOptions options) {
  falcon_.plug();
  device_ = std::make_unique<FalconDevice>(std::move(options));
  const Status opened = device_->open(1000);
  ASSERT_TRUE(opened.ok()) << opened.error().message;
}

bool FalconOnUsb::tickUntil(const std::function<bool()>& holds, Vec3 force_W_N) {
  const std::int64_t end_ns = machineTime().nowNs() + std::chrono::nanoseconds(kPatience).count();
  while (machineTime().nowNs() < end_ns) {
    last_read_ = device_->read(reading_);
    gate_.admit(TipSample{}, true, 0);
    device_->write(gate_.guard(Wrench{force_W_N, {}}));
    if (holds()) return true;
    machineTime().sleepForNs(1'000'000);
  }
  return false;
}

bool FalconOnUsb::waitForFresh() {
  return tickUntil([this] { return last_read_ == DeviceRead::kFresh; });
}

void FalconOnUsb::moveOutAndIn() {
  falcon_.hold([](double t_s) { return Vec3{std::fmod(t_s, 0.1) < 0.05 ? 0.035 : -0.035, 0, 0}; });
}

void FalconOnUsb::home() {
  moveOutAndIn();
  ASSERT_TRUE(waitForFresh()) << device_->status();
  falcon_.holdAt({});
}

}  // namespace needlelab::test
