/// Transport of bytes to a Falcon: libusb (falcon_usb.cpp), or a test's stand-in. Thread: one at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/falcon/falcon_packet.h"
#include "common/base/result.h"
#include "common/base/time/time_source.h"

namespace needlelab::falcon {

/// The FTDI USB-to-serial chip in front of the Falcon's processor, opened: control requests, bytes out, bytes
/// in. Each call blocks until it is done. Errors: kUnavailable when the device is gone or does not answer.
/// Thread: the one that opened it.
class FtdiPort {
 public:
  virtual ~FtdiPort() = default;
  /// A vendor request to the device (type 0x40, no data).
  virtual Status control(std::uint8_t request, std::uint16_t value, std::uint16_t index) = 0;
  /// Writes all of `bytes`, or returns an error.
  virtual Status write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds timeout) = 0;
  /// Does one raw USB read, modem bytes included (falcon_packet.h); 0 bytes on timeout.
  virtual Result<std::size_t> read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) = 0;
};

/// Receives a link's events, inside `wait`.
class LinkListener {
 public:
  virtual ~LinkListener() = default;
  /// One raw USB read, modem bytes included, at `now_ns` of the link's time.
  virtual void onRead(std::span<const std::uint8_t> raw, std::int64_t now_ns) noexcept = 0;
  /// The write started by `send` has ended; `done` when the device took all of it.
  virtual void onSent(bool done) noexcept = 0;
};

/// One opened Falcon. Without a stream it works as an FtdiPort; during a stream reads are always pending and
/// writes do not block. The destructor cancels pending transfers and releases the device.
class FalconLink : public FtdiPort {
 public:
  virtual Status startStream(LinkListener& listener) = 0;
  /// Starts to write `packet`. Returns false while another write is pending, or when the device is lost.
  virtual bool send(const Packet& packet) noexcept = 0;
  /// Handles events until one occurs or the link's time reaches `until_ns`.
  virtual void wait(std::int64_t until_ns) noexcept = 0;
  /// Whether the device is gone: sending and reading then fail.
  [[nodiscard]] virtual bool lost() const noexcept = 0;
  /// Cancels pending transfers. The link works as an FtdiPort again.
  virtual void stopStream() noexcept = 0;
};

/// Finds Falcons.
class FalconBus {
 public:
  virtual ~FalconBus() = default;
  /// Returns one entry per Falcon.
  virtual Result<std::vector<FoundDevice>> list() = 0;
  /// Opens the Falcon with the serial number or bus path `which` ("1-4.2"); empty: the only one. Errors:
  /// kNotFound, kDenied, kUnavailable, kInvalidInput, with advice.
  virtual Result<std::unique_ptr<FalconLink>> open(const std::string& which) = 0;
  /// Returns when a Falcon may have been plugged in, or at `until_ns`.
  virtual void waitForArrival(std::int64_t until_ns) noexcept = 0;
};

/// Returns the Falcons on this computer's USB, through libusb, which starts at its first use. The bus must
/// outlive its links, and `time` the bus.
std::unique_ptr<FalconBus> makeUsbBus(TimeSource& time = machineTime());

}  // namespace needlelab::falcon
