/// Loads the vendor's firmware into a Falcon, which loses it when switched off. The user provides the file;
/// we may not ship it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_link.h"
#include "common/base/result.h"
#include "common/base/time/time_source.h"

namespace needlelab::falcon {

/// The chip's requests and values (FTDI's own numbers, as in the Linux driver ftdi_sio's header).
enum FtdiRequest : std::uint8_t {
  kFtdiReset = 0,         ///< value 1: purge received bytes, 2: purge bytes to send
  kFtdiModemControl = 1,  ///< bit 0 DTR, bit 1 RTS; the mask of bits to change is 8 bits higher
  kFtdiFlowControl = 2,   ///< index 0: none
  kFtdiBaudRate = 3,
  kFtdiData = 4,
  kFtdiLatency = 9,  ///< ms after which the chip passes on a partial packet
};
inline constexpr std::uint16_t kPurgeIn = 1, kPurgeOut = 2;
inline constexpr std::uint16_t kDtrHigh = 0x0101, kDtrLow = 0x0100, kRtsLow = 0x0200;
inline constexpr std::uint16_t kData8N1 = 8;

/// The chip's divisor of 3 MHz: whole part in bits 0-13, eighths coded in bits 14-16, with bit 16 in the
/// index. Chooses the nearest possible rate up to 1.5 million (9600: exact; 140000: 140351; 1456312:
/// 1500000).
struct BaudDivisor {
  std::uint16_t value = 0, index = 0;
  double baud = 0;  ///< the resulting rate
};
BaudDivisor baudDivisor(double baud) noexcept;

inline constexpr double kGreetingBaud = 9600, kLoaderBaud = 140'000, kRunBaud = 1'456'312;

/// Input without the chip's own bytes; keeps bytes beyond the requested count for the next read.
class FtdiInput {
 public:
  FtdiInput(FtdiPort& port, TimeSource& time) : port_(port), time_(time) {}
  /// Appends up to `count` bytes to `bytes`; fewer on timeout.
  Status read(std::size_t count, std::chrono::milliseconds timeout, std::vector<std::uint8_t>& bytes);
  void forget() { kept_.clear(); }

 private:
  FtdiPort& port_;
  TimeSource& time_;
  std::vector<std::uint8_t> kept_;
};

/// Errors: kNotFound, with advice; kInvalidInput: empty, or too long for a Falcon's memory.
Result<std::vector<std::uint8_t>> readFirmware(const std::string& file);

/// Sets the line for a running firmware: latency 1 ms, 1,456,312 baud, 8N1, no flow control, empty buffers in
/// the chip.
Status setRunLine(FtdiPort& port);

/// Sets the line, sends zero torque and waits for a reply, up to `tries` times 50 ms. A Falcon with firmware
/// answers; without firmware it sends no valid reply, or echoes.
Result<bool> firmwareRuns(FtdiPort& port, int tries, TimeSource& time = machineTime());

/// The loader's steps, in order.
enum class LoadStep : std::uint8_t {
  kLine,        ///< purge, latency 16 ms, 9600 8N1, no flow control, RTS low, DTR low then high
  kGreet,       ///< 0A 43 0D, answered by 0A 44 2C 0D
  kSpeedUp,     ///< DTR low, 140,000 baud
  kCall,        ///< 41, answered by 41
  kChunk,       ///< 62 bytes, echoed; repeated to the end of the file
  kRun,         ///< as setRunLine
  kFirstReply,  ///< the new firmware answers a zero-torque command
  kDone,
  kFailed,
};

/// One load, step by step, so that a caller can show progress and stop. A step takes at most about a second.
/// Thread: the port's.
class FirmwareLoader {
 public:
  /// `port`, `firmware` and `time` must outlive the loader. Error messages name `file`.
  FirmwareLoader(FtdiPort& port, std::span<const std::uint8_t> firmware, std::string file,
                 TimeSource& time = machineTime());

  /// Does the next step. Returns false after the last one: see `result`.
  bool step();
  [[nodiscard]] LoadStep next() const { return next_; }
  [[nodiscard]] std::size_t sent() const { return sent_; }
  /// Errors name the step, and for a wrong echo the byte of the file.
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
  TimeSource& time_;
  FtdiInput input_;
  std::span<const std::uint8_t> firmware_;
  std::string file_;
  LoadStep next_ = LoadStep::kLine;
  std::size_t sent_ = 0;
  Status result_;
};

}  // namespace needlelab::falcon
