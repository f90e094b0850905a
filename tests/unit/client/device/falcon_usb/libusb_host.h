/// A host that speaks to the emulated Falcon by plain libusb calls: nothing of our device's code is in it.
#pragma once

#include <gtest/gtest.h>
#include <libusb.h>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "tests/support/falcon_emulator/falcon_emulator.h"

namespace needlelab::test {

/// Ends a test that does not run on the emulated USB; to be the first line of a fixture's SetUp.
#define NEEDLELAB_NEEDS_EMULATED_USB(testbed) \
  if (const std::string why = (testbed).trouble(); !why.empty()) GTEST_SKIP() << why

/// An open Falcon, its interface claimed.
class LibusbHost {
 public:
  LibusbHost();
  ~LibusbHost();
  LibusbHost(const LibusbHost&) = delete;
  LibusbHost& operator=(const LibusbHost&) = delete;

  /// How many Falcons libusb lists now.
  std::size_t count();
  /// libusb's error of opening and claiming the only Falcon; 0: done.
  int open();
  void close();
  [[nodiscard]] libusb_context* context() { return context_; }
  [[nodiscard]] libusb_device_handle* handle() { return handle_; }

  /// A request of FTDI's.
  int request(std::uint8_t number, std::uint16_t value, std::uint16_t index = 0);
  int write(const Bytes& data);
  /// Payload of reads until `count` bytes are there or `patience` is over.
  Bytes read(std::size_t count, std::chrono::milliseconds patience = std::chrono::milliseconds(300));

  /// As the firmware wants to be spoken to.
  void settingsForFirmware();
  /// As the bootloader wants its first word.
  void settingsForBootloader();

 private:
  libusb_context* context_ = nullptr;
  libusb_device_handle* handle_ = nullptr;
};

/// The firmware's packet, written independently from FACTS.
Bytes packetOf(const std::array<int, 3>& values, unsigned bits);
struct Answer {
  std::array<int, 3> values{};
  unsigned bits = 0;
};
/// Nothing when it is not a packet.
std::optional<Answer> answerOf(const Bytes& packet);

}  // namespace needlelab::test
