/// A Falcon's own computer: its bootloader, then its firmware. One for all tests, with its faults as data:
/// behind a link of its own in any time (direct_link.h), or behind the USB chip (falcon_emulator.h).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_packet.h"

namespace needlelab::test {

using Bytes = std::vector<std::uint8_t>;
using Requests = std::vector<std::array<std::uint16_t, 3>>;
using Motors = std::array<std::int16_t, 3>;

/// The serial line, as set by the host through the chip's requests.
struct SerialSettings {
  double baud = 0;    ///< 0: never set
  unsigned data = 0;  ///< 8: 8N1
  bool flow_control_off = false;
  bool dtr = false, rts = true;  ///< RTS is low only if the host has set it low
  unsigned latency_ms = 16;
  bool purged_input = false, purged_output = false;
};
/// Baud rate from the two words of the chip's request: 3 MHz over n + eighths.
double baudOf(std::uint16_t value, std::uint16_t index);

/// What happens to a command in transit and to its answer.
struct Fate {
  bool arrives = true;        ///< the board hears the command
  bool is_answered = true;    ///< and its answer arrives
  bool is_garbled = false;    ///< with a byte that no packet contains
  bool is_torn = false;       ///< its second half arrives half a millisecond later
  std::int64_t reply_ns = 0;  ///< after the command; answers keep their order
};

/// A command that the firmware has heard.
struct Heard {
  falcon::Command command;
  std::int64_t at_ns;
};

/// Thread: any, under its mutex.
class FalconBoard {
 public:
  enum class Mode : std::uint8_t { kWaitsForReset, kWaitsForHello, kWaitsForGo, kLoads, kRuns };

  std::mutex mutex;
  Mode mode = Mode::kRuns;
  std::uint8_t homed = 0x70;  ///< as in a report
  std::uint8_t buttons = 0;
  Motors encoder{};
  Bytes firmware;  ///< the only image that starts; empty: any non-empty one

  // faults
  bool silent = false;                      ///< receives and answers nothing
  bool garbage = false;                     ///< answers garbage
  std::optional<std::size_t> echo_wrong;    ///< this firmware byte is echoed wrongly
  std::optional<std::size_t> echo_missing;  ///< from this byte on nothing is echoed
  std::function<Fate()> fate;               ///< of each command to the running firmware; empty: none is lost

  // for an observer; called under the mutex, may be empty
  std::function<void(const falcon::Command&, std::int64_t now_ns)> on_command;  ///< the firmware got it
  std::function<void(std::size_t place)> on_loaded_byte;
  std::function<void()> on_reset;

  // recorded
  Requests requests;
  Bytes loaded;
  int loads = 0;
  bool keeps_commands = true;  ///< in `heard`
  std::vector<Heard> heard;
  std::string silent_because;  ///< why the board last ignored a byte

  /// Handles a request of the host to the chip; false: no such request.
  bool request(std::uint8_t request, std::uint16_t value, std::uint16_t index);
  /// The host's bytes; the board's go to `say`, each with its arrival time at the host.
  void receive(std::span<const std::uint8_t> bytes, std::int64_t now_ns);
  std::function<void(std::uint8_t byte, std::int64_t at_ns)> say;

  [[nodiscard]] bool runs() const { return mode == Mode::kRuns; }
  /// Power-on without firmware.
  void forgetFirmware() { mode = Mode::kWaitsForReset; }
  [[nodiscard]] const SerialSettings& settings() const { return settings_; }
  [[nodiscard]] falcon::Command last() {
    const std::scoped_lock lock(mutex);
    return heard.empty() ? falcon::Command{{-1, -1, -1}, 0xFF} : heard.back().command;
  }

 private:
  void ignore(std::string why);
  void receive(std::uint8_t byte, std::int64_t now_ns);
  void sayAll(std::span<const std::uint8_t> bytes, std::int64_t at_ns);
  void hear(std::uint8_t byte, std::int64_t now_ns);
  void load(std::uint8_t byte, std::int64_t now_ns);
  void command(std::uint8_t byte, std::int64_t now_ns);
  void obey(std::int64_t now_ns);

  SerialSettings settings_;
  Bytes word_;  // so far
};

}  // namespace needlelab::test
