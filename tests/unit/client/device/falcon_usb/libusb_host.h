/// A host that uses the emulated Falcon by plain libusb calls and contains none of our device code.
#pragma once

#include <gtest/gtest.h>
#include <libusb.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "tests/support/falcon_emulator/falcon_emulator.h"
#include "tests/support/patience.h"

namespace needlelab::test {

/// Ends a test that does not run on the emulated USB. Must be the first line of a fixture's SetUp.
#define NEEDLELAB_NEEDS_EMULATED_USB(testbed) \
  if (const std::string why = (testbed).trouble(); !why.empty()) GTEST_SKIP() << why

/// An open Falcon with a claimed interface.
class LibusbHost {
 public:
  LibusbHost();
  ~LibusbHost();
  LibusbHost(const LibusbHost&) = delete;
  LibusbHost& operator=(const LibusbHost&) = delete;

  /// Returns the number of Falcons that libusb lists now.
  std::size_t count();
  /// Opens and claims the only Falcon. Returns libusb's error, 0 on success.
  int open();
  void close();
  [[nodiscard]] libusb_context* context() { return context_; }
  [[nodiscard]] libusb_device_handle* handle() { return handle_; }

  /// Sends an FTDI request.
  int request(std::uint8_t number, std::uint16_t value, std::uint16_t index = 0);
  int write(const Bytes& data);
  /// Reads until `count` bytes have arrived or `patience` has passed. Returns the payload.
  Bytes read(std::size_t count, std::chrono::milliseconds patience = kPatience);

  /// Sets the serial line for the firmware.
  void settingsForFirmware();
  /// Sets the serial line for the bootloader's first message.
  void settingsForBootloader();

 private:
  libusb_context* context_ = nullptr;
  libusb_device_handle* handle_ = nullptr;
};

/// Makes the firmware's packet; written independently from FACTS.
Bytes packetOf(const std::array<int, 3>& values, unsigned bits);
struct Answer {
  std::array<int, 3> values{};
  unsigned bits = 0;
};
/// Returns nothing if the bytes are not a packet.
std::optional<Answer> answerOf(const Bytes& packet);

}  // namespace needlelab::test
