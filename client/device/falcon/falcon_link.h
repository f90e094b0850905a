/// Transport of bytes to a Falcon: libusb (falcon_usb.cpp), or a test's stand-in. All of it is used by one
/// thread at a time.
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

namespace needlelab::falcon {

/// The FTDI USB-to-serial chip in front of the Falcon's processor, opened: control requests, bytes out, bytes
/// in. Each call waits for its end. Errors: kUnavailable when the device is gone or does not answer. Thread:
/// the one that opened it.
class FtdiPort {
 public:
  virtual ~FtdiPort() = default;
  /// A vendor request to the device (type 0x40, no data).
  virtual Status control(std::uint8_t request, std::uint16_t value, std::uint16_t index) = 0;
  /// All of `bytes`, or an error.
  virtual Status write(std::span<const std::uint8_t> bytes, std::chrono::milliseconds timeout) = 0;
  /// One USB read as it came, modem bytes and all (falcon_packet.h); 0 bytes when the time is over.
  virtual Result<std::size_t> read(std::span<std::uint8_t> buffer, std::chrono::milliseconds timeout) = 0;
};

/// Gets a link's events, within `wait`.
class LinkListener {
 public:
  virtual ~LinkListener() = default;
  /// One USB read as it came, modem bytes and all, at `now_ns` (steadyNowNs).
  virtual void onRead(std::span<const std::uint8_t> raw, std::int64_t now_ns) noexcept = 0;
  /// The write that `send` began has ended; `done` when the device took all of it.
  virtual void onSent(bool done) noexcept = 0;
};

/// One opened Falcon. As FtdiPort while no stream runs; then reads are always pending and writes do not wait.
/// Its destructor lets the device go, with all that was under way.
class FalconLink : public FtdiPort {
 public:
  virtual Status startStream(LinkListener& listener) = 0;
  /// Begins to write `packet`. False when one is still under way, or the device is lost.
  virtual bool send(const Packet& packet) noexcept = 0;
  /// Handles events until one happened or `steadyNowNs` reaches `until_ns`.
  virtual void wait(std::int64_t until_ns) noexcept = 0;
  /// The device is gone: nothing can be sent or read any more.
  [[nodiscard]] virtual bool lost() const noexcept = 0;
  /// Ends all that is under way. The link may be used as FtdiPort again.
  virtual void stopStream() noexcept = 0;
};

/// Where Falcons are found.
class FalconBus {
 public:
  virtual ~FalconBus() = default;
  /// One entry for each Falcon; empty when there is none.
  virtual Result<std::vector<FoundDevice>> list() = 0;
  /// Opens the one that `which` names by serial number or bus path ("1-4.2"); empty: the only one.
  /// Errors (kNotFound, kDenied, kUnavailable, kInvalidInput) say what to do.
  virtual Result<std::unique_ptr<FalconLink>> open(const std::string& which) = 0;
  /// Returns when a Falcon may have been plugged in, or when the time is over.
  virtual void waitForArrival(std::chrono::milliseconds timeout) noexcept = 0;
};

/// Falcons on this computer's USB, through libusb, which is started at its first use. The bus must outlive
/// its links.
std::unique_ptr<FalconBus> makeUsbBus();

}  // namespace needlelab::falcon
