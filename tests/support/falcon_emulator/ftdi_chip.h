/// FTDI's USB-to-serial chip, as the host sees it.
#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include "tests/support/falcon_emulator/usb_peripheral.h"

namespace needlelab::test {

/// Settings of the chip's serial side.
struct SerialSettings {
  double baud = 0;                                    ///< 0: never set
  unsigned data_bits = 0, parity = 0, stop_bits = 0;  ///< 8, 0, 0 is 8N1
  bool flow_control_off = false;                      ///< set to none by the host
  bool dtr = false, rts = false;
  bool rts_was_set = false;
  unsigned latency_ms = 16;
  bool purged_input = false, purged_output = false;  ///< since the reset of the chip
};

/// The peer on the serial line.
class SerialPeer {
 public:
  virtual ~SerialPeer() = default;
  /// A byte arrives, sent with `settings`.
  virtual void receive(std::uint8_t byte, const SerialSettings& settings, TimePoint at) = 0;
  /// The modem lines changed.
  virtual void lines(const SerialSettings& settings, bool dtr_rose) = 0;
};

/// Simulated faults of the line to the host; all off at the start.
struct LineTrouble {
  bool nak_in = false;            ///< no bulk transfer to the host ends, not even the chip's own two bytes
  bool nak_out = false;           ///< none from the host is taken
  std::size_t short_packets = 0;  ///< at most so many bytes of data in a packet; 0: 62
  std::size_t drop_every = 0;     ///< each n-th byte from the device is lost; 0: none
  std::chrono::microseconds delay{0};  ///< the device's bytes come later by this
};

/// Thread: under the port's lock.
class FtdiChip : public UsbPeripheral {
 public:
  FtdiChip(SerialPeer& peer, UsbIdentity identity) : peer_(peer), identity_(std::move(identity)) {}

  [[nodiscard]] UsbIdentity identity() const override { return identity_; }
  std::optional<Bytes> control(const UsbSetup& setup, TimePoint now) override;
  bool out(std::span<const std::uint8_t> data, TimePoint now) override;
  std::optional<Bytes> in(std::size_t room, TimePoint now) override;
  [[nodiscard]] TimePoint nextEvent(std::size_t room, TimePoint now) const override;

  /// The peer sends a byte at time `at`.
  void send(std::uint8_t byte, TimePoint at);
  /// As after power-on.
  void reset();

  [[nodiscard]] const SerialSettings& settings() const { return settings_; }
  [[nodiscard]] LineTrouble& trouble() { return trouble_; }
  /// Bytes lost because the chip's buffer was full.
  [[nodiscard]] std::uint64_t overrun() const { return overrun_; }

 private:
  struct Pending {
    TimePoint at;
    std::uint8_t byte;
  };
  [[nodiscard]] Clock::duration byteTime() const;
  [[nodiscard]] Clock::duration latency() const { return std::chrono::milliseconds(settings_.latency_ms); }
  [[nodiscard]] std::size_t perPacket() const;
  [[nodiscard]] std::size_t arrived(TimePoint now) const;

  SerialPeer& peer_;
  UsbIdentity identity_;
  SerialSettings settings_;
  LineTrouble trouble_;
  std::deque<Pending> to_host_;
  TimePoint sent_until_{}, answered_until_{}, deadline_{};
  std::uint64_t overrun_ = 0, bytes_from_peer_ = 0;
  bool overrun_flag_ = false;
};

/// Baud rate from the two words of the chip's request: 3 MHz over n + eighths.
double baudOf(std::uint16_t value, std::uint16_t index);

}  // namespace needlelab::test
