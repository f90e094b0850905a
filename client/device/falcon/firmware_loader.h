/// Puts the vendor's firmware into a Falcon that has none: it forgets it when its power goes. The file is the
/// user's; it is not ours to ship.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_link.h"
#include "common/base/result.h"

namespace needlelab::falcon {

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
  double baud = 0;  ///< the rate that results
};
BaudDivisor baudDivisor(double baud) noexcept;

inline constexpr double kGreetingBaud = 9600, kLoaderBaud = 140'000, kRunBaud = 1'456'312;

/// Input without the chip's own bytes; bytes beyond the requested count are kept for the next read.
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

/// Errors: kNotFound, with what to do; kInvalidInput: empty, or longer than a Falcon's memory could be.
Result<std::vector<std::uint8_t>> readFirmware(const std::string& file);

/// Sets the line for a running firmware: latency 1 ms, 1,456,312 baud, 8N1, no flow control, nothing left in
/// the chip.
Status setRunLine(FtdiPort& port);

/// Sets the line, sends zero torque and looks for a reply, up to `tries` times 50 ms: a Falcon that runs its
/// firmware answers; one without firmware sends nothing that fits, or echoes.
Result<bool> firmwareRuns(FtdiPort& port, int tries);

/// The loader's steps, in their order.
enum class LoadStep : std::uint8_t {
  kLine,        ///< purge, latency 16 ms, 9600 8N1, no flow control, RTS low, DTR low then high
  kGreet,       ///< 0A 43 0D, answered by 0A 44 2C 0D
  kSpeedUp,     ///< DTR low, 140,000 baud
  kCall,        ///< 41, answered by 41
  kChunk,       ///< 62 bytes, echoed; as often as it takes
  kRun,         ///< as setRunLine
  kFirstReply,  ///< the new firmware answers zero torque
  kDone,
  kFailed,
};

/// One load, a step at a time, so that a caller can show how far it is and can stop. A step waits at most
/// about a second. Thread: the port's.
class FirmwareLoader {
 public:
  /// `port` and `firmware` must outlive it. `file` is named in errors.
  FirmwareLoader(FtdiPort& port, std::span<const std::uint8_t> firmware, std::string file);

  /// Does the next step. False when it was the last: see `result`.
  bool step();
  [[nodiscard]] LoadStep next() const { return next_; }
  [[nodiscard]] std::size_t sent() const { return sent_; }
  /// Errors say at which step, and for an echo that differs at which byte of the file.
  [[nodiscard]] const Status& result() const { return result_; }

  static constexpr std::size_t kChunkBytes = 62;

 private:
  Status doStep();
  Status setLine();
  Status exchange(std::span<const std::uint8_t> question, std::span<const std::uint8_t> answer,
                  const char* what);
  Status sendChunk();
  Status firstReply();

  FtdiPort& port_;
  FtdiInput input_;
  std::span<const std::uint8_t> firmware_;
  std::string file_;
  LoadStep next_ = LoadStep::kLine;
  std::size_t sent_ = 0;
  Status result_;
};

}  // namespace needlelab::falcon
