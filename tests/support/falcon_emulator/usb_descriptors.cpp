#include "tests/support/falcon_emulator/usb_port.h"

namespace needlelab::test {
namespace {

std::uint8_t low(std::uint16_t value) {
  return static_cast<std::uint8_t>(value & 0xFFu);
}
std::uint8_t high(std::uint16_t value) {
  return static_cast<std::uint8_t>(value >> 8);
}

// a string descriptor: length, kind, UTF-16
Bytes text(const std::string& ascii) {
  Bytes bytes{static_cast<std::uint8_t>(2 + 2 * ascii.size()), 3};
  for (const char c : ascii) {
    bytes.push_back(static_cast<std::uint8_t>(c));
    bytes.push_back(0);
  }
  return bytes;
}

}  // namespace

Bytes deviceDescriptor(const UsbIdentity& identity) {
  return {18,
          1,
          0x00,
          0x02,  // USB 2.0
          0,
          0,
          0,
          8,  // endpoint 0: 8 bytes
          low(identity.vendor),
          high(identity.vendor),
          low(identity.product),
          high(identity.product),
          low(identity.release),
          high(identity.release),
          1,
          2,
          3,  // strings: maker, product, serial number
          1};
}

Bytes configurationDescriptor(const UsbIdentity& identity) {
  return {9,    2,    32,
          0,    1,    1,
          0,    0xA0, 45,  // 32 bytes in all, one interface, 90 mA
          9,    4,    0,
          0,    2,    0xFF,
          0xFF, 0xFF, 2,  // the vendor's own class, two endpoints
          7,    5,    identity.in_endpoint,
          2,    64,   0,
          0,  // bulk
          7,    5,    identity.out_endpoint,
          2,    64,   0,
          0};
}

std::optional<Bytes> standardRequest(const UsbIdentity& identity, const UsbSetup& setup) {
  constexpr std::uint8_t kGetStatus = 0, kGetDescriptor = 6, kGetConfiguration = 8;
  if (setup.request == kGetDescriptor) {
    const unsigned kind = setup.value >> 8, which = setup.value & 0xFFu;
    if (kind == 1) return deviceDescriptor(identity);
    if (kind == 2) return configurationDescriptor(identity);
    if (kind == 3 && which == 0) return Bytes{4, 3, 0x09, 0x04};  // English
    if (kind == 3 && which == 1) return text(identity.manufacturer);
    if (kind == 3 && which == 2) return text(identity.product_name);
    if (kind == 3 && which == 3) return text(identity.serial);
    return std::nullopt;
  }
  if (setup.request == kGetStatus) return Bytes{0, 0};
  if (setup.request == kGetConfiguration) return Bytes{1};
  if ((setup.type & 0x80u) == 0) return Bytes{};  // set configuration, clear feature …: taken note of
  return std::nullopt;
}

}  // namespace needlelab::test
