// Tests the emulated USB port and its firmware by plain libusb calls.
#include <atomic>
#include <functional>
#include <thread>

#include "tests/unit/client/device/falcon_usb/libusb_host.h"

namespace needlelab::test {
namespace {

// Returns false if it does not happen before a hang is assumed.
bool waitUntil(const std::function<bool()>& done) {
  const TimePoint end = Clock::now() + kPatience;
  while (!done() && Clock::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  return done();
}

class EmulatedUsb : public testing::Test {
 protected:
  void SetUp() override { NEEDLELAB_NEEDS_EMULATED_USB(testbed_); }
  void start() {
    falcon_.plug();
    host_ = std::make_unique<LibusbHost>();
    ASSERT_EQ(host_->open(), 0);
    host_->settingsForFirmware();
  }

  UsbTestbed testbed_;
  FalconEmulator falcon_{testbed_};
  std::unique_ptr<LibusbHost> host_;
};

TEST_F(EmulatedUsb, listsTheDeviceWithItsStrings) {
  start();
  EXPECT_EQ(host_->count(), 1u);
  unsigned char text[64] = {};
  EXPECT_GT(libusb_get_string_descriptor_ascii(host_->handle(), 3, text, sizeof text), 0);
  EXPECT_STREQ(reinterpret_cast<char*>(text), "FALCON01");
}

TEST_F(EmulatedUsb, answersEachPacketWithOne) {
  start();
  falcon_.setButtons(0b1010);
  host_->write(packetOf({100, -200, 4095}, 0x4));
  const auto answer = answerOf(host_->read(16));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->bits, 0b1010u);
  EXPECT_EQ(answer->values, (std::array<int, 3>{0, 0, 0}));  // encoders count from power-on
  EXPECT_EQ(falcon_.lights(), 0x4u);
  const auto seen = falcon_.history();
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].motors, (std::array<std::int16_t, 3>{100, -200, 4095}));
}

TEST_F(EmulatedUsb, encodersFindZeroOnlyWhenAskedAndPassed) {
  start();
  const auto ask = [this](unsigned bits) {
    host_->write(packetOf({0, 0, 0}, bits));
    return answerOf(host_->read(16)).value_or(Answer{});
  };
  const Eigen::Vector3d out(0, 0, 0.16), in(0, 0, 0.09);
  falcon_.holdAt(out);
  ask(0);
  falcon_.holdAt(in);
  EXPECT_EQ(ask(0).bits, 0u) << "not asked for";
  ask(1);
  EXPECT_EQ(ask(1).bits, 0u) << "not passed";
  falcon_.holdAt(out);
  const Answer found = ask(1);
  EXPECT_EQ(found.bits, 0x70u);
  const AllLegs legs = anglesAt(out);
  for (std::size_t leg = 0; leg < 3; ++leg) {
    const double counts = (legs[leg][0] - 40 * M_PI / 180) * 1280 * 7.62 / (2 * M_PI);
    EXPECT_NEAR(found.values[leg], counts, 0.51);
  }
}

TEST_F(EmulatedUsb, handFeelsWhatTheMotorsPush) {
  start();
  const Eigen::Vector3d middle(0, 0, 0.125);
  falcon_.holdSoftly({.mass_kg = 0.25, .stiffness_N_per_m = 300, .damping_Ns_per_m = 20},
                     [middle](double) { return middle; });
  host_->write(packetOf({500, 500, 500}, 0));
  host_->read(16);
  const auto off = [&] { return (falcon_.grip() - middle - falcon_.force() / 300).norm(); };
  EXPECT_TRUE(waitUntil([&] { return falcon_.force().norm() > 0.5 && off() < 2e-4; }))
      << falcon_.force().norm() << " N, " << off() << " m from the spring's rest";
}

TEST_F(EmulatedUsb, withoutDataEachLatencyBringsTwoBytes) {
  start();
  const UsbCounts before = falcon_.port().counts();
  for (int i = 0; i < 20; ++i) {
    unsigned char data[64];
    int size = 0;
    ASSERT_EQ(libusb_bulk_transfer(host_->handle(), 0x81, data, 64, &size, 60'000), 0);
    EXPECT_EQ(size, 2);
  }
  EXPECT_EQ(falcon_.port().counts().in_transfers - before.in_transfers, 20u);
}

// a transfer in flight, ended by a callback
struct InFlight {
  libusb_transfer* transfer = libusb_alloc_transfer(0);
  std::array<unsigned char, 64> data{};
  int done = 0;
  ~InFlight() { libusb_free_transfer(transfer); }
  void submit(LibusbHost& host, unsigned char endpoint) {
    const auto ended = [](libusb_transfer* one) { *static_cast<int*>(one->user_data) = 1; };
    libusb_fill_bulk_transfer(transfer, host.handle(), endpoint, data.data(), 64, ended, &done, 0);
    ASSERT_EQ(libusb_submit_transfer(transfer), 0);
  }
  void wait(LibusbHost& host) {
    const TimePoint end = Clock::now() + kPatience;
    while (done == 0 && Clock::now() < end) {
      timeval patience{0, 100'000};
      libusb_handle_events_timeout_completed(host.context(), &patience, &done);
    }
    ASSERT_EQ(done, 1);
  }
};

TEST_F(EmulatedUsb, transfersInFlightEndWhenItIsUnplugged) {
  start();
  LineTrouble nak;
  nak.nak_in = nak.nak_out = true;
  falcon_.setLineTrouble(nak);
  InFlight in, out;
  in.submit(*host_, 0x81);
  out.submit(*host_, 0x02);
  EXPECT_EQ(falcon_.port().transfersInFlight(), 2);
  falcon_.unplug();
  in.wait(*host_);
  out.wait(*host_);
  EXPECT_EQ(in.transfer->status, LIBUSB_TRANSFER_NO_DEVICE);
  EXPECT_EQ(out.transfer->status, LIBUSB_TRANSFER_NO_DEVICE);
  EXPECT_EQ(host_->request(9, 1), LIBUSB_ERROR_NO_DEVICE);
  host_->close();
  EXPECT_EQ(host_->count(), 0u);
}

TEST_F(EmulatedUsb, transfersCanBeTakenBack) {
  start();
  LineTrouble nak;
  nak.nak_in = true;
  falcon_.setLineTrouble(nak);
  InFlight in;
  in.submit(*host_, 0x81);
  ASSERT_EQ(libusb_cancel_transfer(in.transfer), 0);
  in.wait(*host_);
  EXPECT_EQ(in.transfer->status, LIBUSB_TRANSFER_CANCELLED);
  EXPECT_EQ(falcon_.port().counts().discarded, 1u);
}

TEST_F(EmulatedUsb, comesBackUnderAnotherNumber) {
  start();
  const std::string first = falcon_.port().node();
  falcon_.unplug();
  host_->close();
  falcon_.plug();
  EXPECT_NE(falcon_.port().node(), first);
  ASSERT_TRUE(waitUntil([&] { return host_->count() == 1; }));
  ASSERT_EQ(host_->open(), 0);
  host_->settingsForFirmware();
  host_->write(packetOf({0, 0, 0}, 0));
  EXPECT_TRUE(answerOf(host_->read(16)));
}

TEST_F(EmulatedUsb, hotplugIsSeen) {
  host_ = std::make_unique<LibusbHost>();
  struct Seen {
    std::atomic<int> arrived{0}, left{0};
  } seen;
  libusb_hotplug_callback_handle callback = 0;
  const auto note = [](libusb_context*, libusb_device*, libusb_hotplug_event event, void* data) {
    auto* const count = static_cast<Seen*>(data);
    ++(event == LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED ? count->arrived : count->left);
    return 0;
  };
  const int both = LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT;
  ASSERT_EQ(libusb_hotplug_register_callback(host_->context(), both, 0, 0x0403, 0xcb48,
                                             LIBUSB_HOTPLUG_MATCH_ANY, note, &seen, &callback),
            0);
  const auto waitFor = [this](const std::atomic<int>& count, int wanted) {
    const TimePoint end = Clock::now() + kPatience;
    while (count < wanted && Clock::now() < end) {
      timeval patience{0, 20'000};
      libusb_handle_events_timeout_completed(host_->context(), &patience, nullptr);
    }
    EXPECT_EQ(count, wanted);
  };
  for (int round = 1; round <= 3; ++round) {
    falcon_.plug();
    waitFor(seen.arrived, round);
    falcon_.unplug();
    waitFor(seen.left, round);
  }
}

TEST_F(EmulatedUsb, oneHostAtATime) {
  start();
  LibusbHost other;
  EXPECT_EQ(other.open(), LIBUSB_ERROR_BUSY);
  host_->close();
  EXPECT_EQ(other.open(), 0);
}

TEST_F(EmulatedUsb, aKernelDriverIsInTheWayUntilDetached) {
  falcon_.port().setKernelDriver("ftdi_sio");
  falcon_.plug();
  LibusbHost host;
  EXPECT_EQ(host.open(), LIBUSB_ERROR_BUSY);
  libusb_device_handle* const handle = libusb_open_device_with_vid_pid(host.context(), 0x0403, 0xcb48);
  ASSERT_NE(handle, nullptr);
  EXPECT_EQ(libusb_kernel_driver_active(handle, 0), 1);
  EXPECT_EQ(libusb_detach_kernel_driver(handle, 0), 0);
  EXPECT_EQ(libusb_claim_interface(handle, 0), 0);
  EXPECT_FALSE(falcon_.port().kernelDriverAttached());
  libusb_close(handle);
}

TEST_F(EmulatedUsb, shortPacketsCarryTheSameBytes) {
  start();
  LineTrouble trouble;
  trouble.short_packets = 3;
  falcon_.setLineTrouble(trouble);
  host_->write(packetOf({1, 2, 3}, 0));
  EXPECT_TRUE(answerOf(host_->read(16)));
}

TEST_F(EmulatedUsb, aClosedHostLeavesNothingBehind) {
  start();
  EXPECT_EQ(falcon_.port().openClients(), 1);
  host_.reset();
  EXPECT_TRUE(waitUntil([&] { return falcon_.port().openClients() == 0; }));
  EXPECT_EQ(falcon_.port().transfersInFlight(), 0);
}

}  // namespace
}  // namespace needlelab::test
