/// Puts the vendor's firmware into a Falcon that has none: it forgets it when its power goes. The file is the
/// user's; it is not ours to ship.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/device/falcon/ftdi_port.h"
#include "common/base/result.h"

namespace needlelab::falcon {

/// Errors: kNotFound, with what to do; kInvalidInput: empty, or longer than a Falcon's memory could be.
Result<std::vector<std::uint8_t>> readFirmware(const std::string& file);

/// Sets the line for a running firmware: latency 1 ms, 1,456,312 baud, 8N1, no flow control, nothing left in
/// the chip.
Status setRunLine(FtdiPort& port);

/// Sets the line, sends zero torque and looks for a reply, up to `tries` times 50 ms: a Falcon whose firmware
/// runs answers, one without says nothing that fits, or what it was told.
Result<bool> firmwareRuns(FtdiPort& port, int tries);

/// The loader's steps, in their order.
enum class LoadStep : std::uint8_t {
  kLine,       ///< purge, latency 16 ms, 9600 8N1, no flow control, RTS low, DTR low then high
  kGreet,      ///< 0A 43 0D, answered by 0A 44 2C 0D
  kSpeedUp,    ///< DTR low, 140,000 baud
  kKnock,      ///< 41, answered by 41
  kChunk,      ///< 62 bytes, echoed; as often as it takes
  kRun,        ///< as setRunLine
  kFirstWord,  ///< the new firmware answers zero torque
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
  Status ask(std::span<const std::uint8_t> question, std::span<const std::uint8_t> answer, const char* what);
  Status sendChunk();
  Status firstWord();

  FtdiPort& port_;
  FtdiInput input_;
  std::span<const std::uint8_t> firmware_;
  std::string file_;
  LoadStep next_ = LoadStep::kLine;
  std::size_t sent_ = 0;
  Status result_;
};

}  // namespace needlelab::falcon
