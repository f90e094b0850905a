#include "client/device/falcon/ftdi_port.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "client/device/falcon/falcon_packet.h"
#include "common/base/clock.h"

namespace needlelab::falcon {

BaudDivisor baudDivisor(double baud) noexcept {
  constexpr double kClock = 3e6;
  // eighths 0-7 as the chip codes them
  constexpr std::array<unsigned, 8> kCode = {0, 3, 2, 4, 1, 5, 6, 7};
  // of the two divisors around the wanted one, that whose rate is nearer
  const double wanted = std::clamp(kClock / baud, 2.0, 16383.0);
  const double below = std::floor(wanted * 8), above = below + 1;
  const bool lower = std::fabs(kClock * 8 / below - baud) <= std::fabs(kClock * 8 / above - baud);
  const auto eighths = static_cast<unsigned>(lower ? below : above);
  BaudDivisor divisor;
  divisor.baud = kClock * 8 / eighths;
  const unsigned coded = (eighths >> 3) | (kCode[eighths & 7] << 14);
  divisor.value = static_cast<std::uint16_t>(coded & 0xFFFF);
  divisor.index = static_cast<std::uint16_t>(coded >> 16);
  return divisor;
}

Status FtdiInput::read(std::size_t count, std::chrono::milliseconds timeout,
                       std::vector<std::uint8_t>& bytes) {
  const std::int64_t end_ns = steadyNowNs() + std::chrono::nanoseconds(timeout).count();
  std::size_t missing = count;
  for (;;) {
    const std::size_t taken = std::min(missing, kept_.size());
    const auto until = kept_.begin() + static_cast<std::ptrdiff_t>(taken);
    bytes.insert(bytes.end(), kept_.begin(), until);
    kept_.erase(kept_.begin(), until);
    missing -= taken;
    const std::int64_t left_ns = end_ns - steadyNowNs();
    if (missing == 0 || left_ns <= 0) return {};

    std::array<std::uint8_t, 8 * kUsbPacketBytes> buffer{};
    const auto left = std::chrono::milliseconds(1 + left_ns / 1'000'000);
    const auto got = port_.read(buffer, left);
    if (!got.ok()) return got.error();
    eachPayloadByte(std::span(buffer).first(*got), [&](std::uint8_t byte) { kept_.push_back(byte); });
  }
}

}  // namespace needlelab::falcon
