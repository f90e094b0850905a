/// What hangs on an emulated USB port: the electronics behind the descriptors.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace needlelab::test {

using Clock = std::chrono::steady_clock;
using TimePoint = Clock::time_point;
using Bytes = std::vector<std::uint8_t>;

/// The eight bytes that begin a control transfer.
struct UsbSetup {
  std::uint8_t type = 0, request = 0;
  std::uint16_t value = 0, index = 0, length = 0;
};

struct UsbIdentity {
  std::uint16_t vendor = 0, product = 0, release = 0;
  std::string manufacturer, product_name, serial;
  std::uint8_t in_endpoint = 0, out_endpoint = 0;
};

/// All calls come under the lock of the port that it hangs on, with a time that never goes back.
class UsbPeripheral {
 public:
  virtual ~UsbPeripheral() = default;
  [[nodiscard]] virtual UsbIdentity identity() const = 0;
  /// A vendor's control request; nothing: stalled. To the host: the bytes; from the host: empty.
  virtual std::optional<Bytes> control(const UsbSetup& setup, TimePoint now) = 0;
  /// Bulk from the host; false: not now (NAK), asked again at `nextEvent`.
  virtual bool out(std::span<const std::uint8_t> data, TimePoint now) = 0;
  /// Bulk to the host: a whole transfer of at most `room` bytes, or nothing yet.
  virtual std::optional<Bytes> in(std::size_t room, TimePoint now) = 0;
  /// When `out` or `in` may say something else than now, if nobody touches it.
  [[nodiscard]] virtual TimePoint nextEvent(std::size_t room, TimePoint now) const = 0;
};

}  // namespace needlelab::test
