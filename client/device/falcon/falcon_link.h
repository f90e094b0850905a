/// What carries bytes to a Falcon: libusb (falcon_usb.h), or a test's stand-in. All of it by one thread at a
/// time.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_packet.h"
#include "client/device/falcon/ftdi_port.h"
#include "client/device/found_device.h"
#include "common/base/result.h"

namespace needlelab::falcon {

/// Told by a link, within `wait`, what happened on the stream.
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
  /// Lets happen what happens, until something did or `steadyNowNs` reaches `until_ns`.
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

}  // namespace needlelab::falcon
