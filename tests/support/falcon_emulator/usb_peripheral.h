/// A device on an emulated USB port: the electronics behind the descriptors.
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

/// The port makes all calls under its lock, with non-decreasing times.
class UsbPeripheral {
 public:
  virtual ~UsbPeripheral() = default;
  [[nodiscard]] virtual UsbIdentity identity() const = 0;
  /// Answers a vendor control request. Empty optional: stalled. To the host: the bytes; from the host: no
  /// bytes.
  virtual std::optional<Bytes> control(const UsbSetup& setup, TimePoint now) = 0;
  /// Takes bulk data from the host; false: not now (NAK), the port retries at `nextEvent`.
  virtual bool out(std::span<const std::uint8_t> data, TimePoint now) = 0;
  /// Bulk to the host: a whole transfer of at most `room` bytes, or nothing yet.
  virtual std::optional<Bytes> in(std::size_t room, TimePoint now) = 0;
  /// The next time when the result of `out` or `in` may change by itself.
  [[nodiscard]] virtual TimePoint nextEvent(std::size_t room, TimePoint now) const = 0;
};

}  // namespace needlelab::test
