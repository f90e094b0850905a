#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <thread>

#include "client/device/falcon/falcon_geometry.h"

namespace needlelab::test {

using namespace std::chrono_literals;

GuardedWrench Pusher::push(Vec3 force_W_N) noexcept {
  gate_.admit(TipSample{}, true, 0);
  return gate_.guard(Wrench{force_W_N, {}});
}

void FalconOnUsb::SetUp() {
  if (const std::string why = testbed_.trouble(); !why.empty()) GTEST_SKIP() << why;
}

void FalconOnUsb::TearDown() {
  if (device_) device_->close();
}

void FalconOnUsb::openDevice(FalconOptions options) {
  falcon_.plug();
  device_ = std::make_unique<FalconDevice>(std::move(options));
  const Status opened = device_->open(1000);
  ASSERT_TRUE(opened.ok()) << opened.error().message;
}

bool FalconOnUsb::runTicks(const std::function<bool()>& tick) {
  const TimePoint end = Clock::now() + kPatience;
  TimePoint due = Clock::now();
  while (Clock::now() < end) {
    if (!tick()) return true;
    due = std::max(due + 1ms, Clock::now());
    std::this_thread::sleep_until(due);
  }
  return false;
}

bool FalconOnUsb::tickUntil(const std::function<bool()>& holds, Vec3 force_W_N) {
  return runTicks([&] {
    last_read_ = device_->read(reading_);
    device_->write(pusher_.push(force_W_N));
    return !holds();
  });
}

bool FalconOnUsb::waitForFresh() {
  return tickUntil([this] { return last_read_ == DeviceRead::kFresh; });
}

HandPath homingPath(double seconds) {
  const Eigen::Vector3d middle(falcon::kOrigin_F_m.x, falcon::kOrigin_F_m.y, falcon::kOrigin_F_m.z);
  return [middle, seconds](double t) {
    const double part = t / seconds;
    const double out = part < 0.5 ? 0.035 : (part < 1 ? -0.035 : 0);
    return Eigen::Vector3d(middle + Eigen::Vector3d(0, 0, out));
  };
}

void FalconOnUsb::home() {
  // repeated, so that a slow machine misses nothing
  falcon_.holdRigidly([path = homingPath(0.1)](double t) { return path(std::fmod(t, 0.1)); });
  ASSERT_TRUE(waitForFresh()) << device_->status();
  falcon_.holdAt({falcon::kOrigin_F_m.x, falcon::kOrigin_F_m.y, falcon::kOrigin_F_m.z});
}

bool waitUntil(const std::function<bool()>& done) {
  const TimePoint end = Clock::now() + kPatience;
  while (!done()) {
    if (Clock::now() > end) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

Bytes anyBytes(std::size_t count, unsigned seed) {
  std::mt19937_64 random(seed);
  Bytes bytes(count);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

}  // namespace needlelab::test
