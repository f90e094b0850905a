/// The Falcon's own computer behind the USB chip: a bootloader, then the loaded firmware.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <random>
#include <string>

#include "tests/support/falcon_emulator/falcon_body.h"
#include "tests/support/falcon_emulator/ftdi_chip.h"

namespace needlelab::test {

/// A command as the firmware received it.
struct CommandSeen {
  TimePoint at;
  std::array<std::int16_t, 3> motors{};
  unsigned bits = 0;
};

/// The board's simulated faults; all off at the start.
struct BoardTrouble {
  bool deaf = false;                     ///< never replies
  bool stall = false;                    ///< the firmware obeys, but does not reply
  std::size_t echo_wrong_at = SIZE_MAX;  ///< this byte of the firmware comes back changed
  std::size_t echo_stops_at = SIZE_MAX;  ///< from this byte on none comes back
  double garbage_share = 0;              ///< of the replies have random bytes before them
  double cut_share = 0;                  ///< of the replies end early
  double flip_share = 0;                 ///< of the replies have one byte changed
};

/// Thread: under the port's lock.
class FalconBoard : public SerialPeer {
 public:
  enum class Mode { kWaitsForReset, kWaitsForHello, kWaitsForGo, kLoads, kRuns };

  /// `firmware`: the only image that starts; empty: any that is not empty.
  FalconBoard(FalconBody& body, Bytes firmware) : body_(body), firmware_(std::move(firmware)) {}
  void connect(FtdiChip& chip) { chip_ = &chip; }

  void receive(std::uint8_t byte, const SerialSettings& settings, TimePoint at) override;
  void lines(const SerialSettings& settings, bool dtr_rose) override;

  /// Power-on: with the firmware in it (`running`), or waiting for it.
  void powerOn(bool running);

  BoardTrouble trouble;
  unsigned buttons = 0;  ///< bit i: button i of the grip is pressed

  [[nodiscard]] Mode mode() const { return mode_; }
  [[nodiscard]] unsigned lights() const { return lights_; }  ///< bits 1-3: green, blue, red
  /// Why the board last ignored a byte; empty: it never did.
  [[nodiscard]] const std::string& silentBecause() const { return silent_because_; }
  [[nodiscard]] std::uint64_t commands() const { return commands_; }
  [[nodiscard]] std::uint64_t badBytes() const { return bad_bytes_; }
  [[nodiscard]] const std::deque<CommandSeen>& history() const { return history_; }  ///< the last 20,000
  [[nodiscard]] std::size_t loadedBytes() const { return image_.size(); }

 private:
  void ignore(std::string why);
  void say(std::initializer_list<std::uint8_t> bytes, TimePoint at);
  void hear(std::uint8_t byte, const SerialSettings& settings, TimePoint at);
  void load(std::uint8_t byte, TimePoint at);
  void command(std::uint8_t byte, TimePoint at);
  void obey(TimePoint at);
  void reply(TimePoint at);

  FalconBody& body_;
  Bytes firmware_;
  FtdiChip* chip_ = nullptr;
  Mode mode_ = Mode::kWaitsForReset;
  Bytes heard_;  ///< of the incomplete word
  Bytes image_;  ///< firmware so far
  unsigned lights_ = 0;
  std::string silent_because_;
  std::uint64_t commands_ = 0, bad_bytes_ = 0;
  std::deque<CommandSeen> history_;
  std::mt19937_64 random_{20261120};
};

}  // namespace needlelab::test
