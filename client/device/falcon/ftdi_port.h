/// The FTDI USB-to-serial chip in front of the Falcon's processor, as the firmware loader needs it: control
/// requests, bytes out, bytes in. Small, so that a test can stand in for it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/base/result.h"

namespace needlelab::falcon {

/// One opened chip. Each call waits for its end. Errors: kUnavailable when the device is gone or does not
/// answer, in words. Thread: the one that opened it.
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

/// The chip's requests and values (FTDI's own numbers, as in the Linux driver ftdi_sio's header).
enum FtdiRequest : std::uint8_t {
  kFtdiReset = 0,         ///< value 1: forget what came in, 2: forget what is to go out
  kFtdiModemControl = 1,  ///< bit 0 DTR, bit 1 RTS; the bits to change 8 higher
  kFtdiFlowControl = 2,   ///< index 0: none
  kFtdiBaudRate = 3,
  kFtdiData = 4,
  kFtdiLatency = 9,  ///< ms after which the chip hands over a packet that is not full
};
inline constexpr std::uint16_t kPurgeIn = 1, kPurgeOut = 2;
inline constexpr std::uint16_t kDtrHigh = 0x0101, kDtrLow = 0x0100, kRtsLow = 0x0200;
inline constexpr std::uint16_t kData8N1 = 8;

/// The chip's divisor of 3 MHz: whole part in bits 0-13, eighths coded in bits 14-16, of which 16 goes to the
/// index. The nearest rate up to 1.5 million that it can make is taken (9600: exact; 140000: 140351; 1456312:
/// 1500000).
struct BaudDivisor {
  std::uint16_t value = 0, index = 0;
  double baud = 0;  ///< what comes of it
};
BaudDivisor baudDivisor(double baud) noexcept;

inline constexpr double kGreetingBaud = 9600, kLoaderBaud = 140'000, kRunBaud = 1'456'312;

/// What comes in, without the chip's own bytes; what is read beyond the asked is kept for the next time.
class FtdiInput {
 public:
  explicit FtdiInput(FtdiPort& port) : port_(port) {}
  /// Appends up to `count` bytes to `bytes`; fewer when the time is over.
  Status read(std::size_t count, std::chrono::milliseconds timeout, std::vector<std::uint8_t>& bytes);
  void forget() { kept_.clear(); }

 private:
  FtdiPort& port_;
  std::vector<std::uint8_t> kept_;
};

}  // namespace needlelab::falcon
