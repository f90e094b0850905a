/// FTDI's USB-to-serial chip in front of the board, as seen by the host's bulk transfers. The board's data
/// are available at once, with the answer to the transfer that brought the command: so the emulated device
/// keeps up with any host, however late this machine wakes a thread.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <span>

#include "tests/support/falcon_emulator/falcon_board.h"

namespace needlelab::test {

/// Thread: under the board's lock.
class FtdiChip {
 public:
  explicit FtdiChip(FalconBoard& board) : board_(board) {
    board.say = [this](std::uint8_t byte, std::int64_t) { to_host_.push_back(byte); };
  }
  [[nodiscard]] FalconBoard& board() { return board_; }

  /// A vendor request; false: stalled.
  bool control(std::uint8_t request, std::uint16_t value, std::uint16_t index);
  /// Accepts bulk data from the host; false: not now.
  bool out(std::span<const std::uint8_t> data, std::int64_t now_ns);
  /// A whole transfer to the host: data, or the chip's own two bytes whenever its latency timer fires;
  /// nothing: not yet.
  std::optional<Bytes> in(std::size_t room, std::int64_t now_ns);
  /// When the timer fires.
  [[nodiscard]] std::int64_t deadlineNs() const {
    return hangs ? std::numeric_limits<std::int64_t>::max() : deadline_ns_;
  }

  bool hangs = false;  ///< no bulk transfer ends, in either direction

 private:
  FalconBoard& board_;
  std::deque<std::uint8_t> to_host_;
  std::int64_t deadline_ns_ = 0;
};

}  // namespace needlelab::test
